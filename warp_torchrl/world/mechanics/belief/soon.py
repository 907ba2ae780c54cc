"""Chances to burn soon: members that are ticked on, with the draws that they will have."""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.ensemble.members import as_known, in_parameters, rows_of, ticked, worlds_of
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.mechanics.belief.beliefs import NAME, beliefs_of, mean_of
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState


def foreseen(state: WorldState, now: Tensor, world: Rules, fire: Automaton, ticks: int) -> WorldState:
    """Return worlds whose beliefs hold the chance of each cell to burn within some ticks, from some worlds' members.

    Args:
        state: The worlds.
        now: Where it is computed, bool [B]; on a CPU there alone.
        world: Their rules.
        fire: The law by which fires are imagined.
        ticks: Of the fire.
    """
    beliefs = beliefs_of(state)
    if not needs_no_sync(now.device):
        soon = torch.where(now[:, None, None, None], burns_within(state, world, fire, ticks), beliefs.soon)
        return state.with_planes(NAME, beliefs.replace(soon=soon))
    index = now.nonzero()[:, 0]
    if not len(index):
        return state
    soon = beliefs.soon.index_copy(0, index, burns_within(state[index], world, fire, ticks))
    return state.with_planes(NAME, beliefs.replace(soon=soon))


def burns_within(state: WorldState, world: Rules, fire: Automaton, ticks: int) -> Tensor:
    """Return the share of the members' weight in which a cell burns now or within some ticks, float32 [B, G, H, W].

    The wind stays.
    """
    beliefs = beliefs_of(state)
    worlds = worlds_of(state, beliefs.members, fire)
    known = beliefs.learning
    values = as_known(worlds, world.fire, fire) if known is None else known.members.flatten(0, 2)
    worlds = in_parameters(worlds, fire, values)
    air = state.air[rows_of(state, beliefs.members.held["key"].shape[1])] if world.air.changes else state.air
    burns, always = is_burning(worlds.cells), torch.ones_like(worlds.done)
    for _ in range(ticks):
        worlds = ticked(worlds, fire, world.air, always, air, values)
        burns = burns | is_burning(worlds.cells)
    return mean_of(beliefs, burns.unflatten(0, beliefs.weights.shape))
