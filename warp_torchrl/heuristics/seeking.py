"""Search: agents go where they would learn most, a step of way, apart from each other."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import agent_distance, extinguish_or, match_cells, target_or_supply
from warp_torchrl.heuristics.paths import first_move
from warp_torchrl.world.arrays.blocks import sums_about
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

_SETTLING = 8.0
"""Steps that a search costs beside its way: near places are left for better ones that are not much farther."""
_APART = 2.3
"""By how much less, as a logarithm, a place is worth that a team-mate will see."""
_LEAST = 1e-9
_TAKEN = 1000.0


def can_act_on_fire(world: World, device: torch.device) -> Tensor:
    """Return which agents can extinguish or clear, bool [A]."""
    can = world.team.table(device).can
    return can["extinguish"] | can["clear"]


def seek(state: WorldState, assumed: WorldState, world: World, mask: Tensor) -> Tensor:
    """Return the actions of agents that search, int64 [B, A].

    Each goes where a search is worth most (``worth_a_search``), and extinguishes what it can.

    Args:
        state: The worlds.
        assumed: See ``World.assumed``: agents avoid the fires that they know.
        world: Their rules.
        mask: The actions that do something, bool [B, A, actions].
    """
    views, target = len(assumed.key) // len(mask), target_or_supply(state, world, worth_a_search(state, world))
    moves = first_move(assumed, world, *(each.repeat_interleave(views, dim=0) for each in (mask, target)))
    return extinguish_or(by_own_view(moves, views), mask)


def worth_a_search(state: WorldState, world: World) -> Tensor:
    """Return where each agent would learn most a step of way, of the cells that team-mates leave, int64 [B, A, 2]:

        score = log(worth of the cells in sight) - log(steps to it + 8)

    Worth is ``World.worth_seeing``.
    """
    worth, agents = world.worth_seeing(state), state.vehicles.position.shape[1]
    sights = [min(each, max(world.size)) for each in world.sensing.reach(world.team)]
    about = {each: sums_about(worth, each).flatten(2) for each in dict.fromkeys(sights)}
    sums = {each: sum_.expand(-1, agents, -1) for each, sum_ in about.items()}
    value = torch.stack([sums[each][:, agent] for agent, each in enumerate(sights)], dim=1)
    cells = torch.arange(value.shape[2], device=value.device).expand(len(value), -1)
    gain = value.clamp(min=_LEAST).log() - (agent_distance(state, cells) + _SETTLING).log()
    return match_cells(state, cells, gain, spacing=2 * max(sights) + 2, discount=_APART, taken=_TAKEN)


def by_own_view(told: Tensor, views: int) -> Tensor:
    """Return what is said to each agent on the map that it assumes, [B, A, ...].

    Args:
        told: Of all agents on every map, [B * views, A, ...].
        views: Maps of a world: 1, or one of each agent.
    """
    told = told.unflatten(0, (-1, views))
    return told[:, 0] if views == 1 else told.diagonal(dim1=1, dim2=2).movedim(-1, 1)
