"""Hidden fires: where one may burn that nobody has seen, drawn from the scenario's ignition and struck out by sight."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.ensemble.members import held, lit, ticked, unburned, worlds_of
from warp_torchrl.world.ignition.ignition import Ignition, IgnitionSource
from warp_torchrl.world.mechanics.belief.beliefs import NAME, Beliefs, cells_of
from warp_torchrl.world.mechanics.belief.sightings import Sightings
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import WorldState

DOUBT = 0.3
"""Factor on how likely a hidden fire is, for each cell that is seen to be otherwise: fires of one place differ."""
_LEAST = 1e-3
"""How likely those must be together of which members take one."""


def fires_lit(lighting: IgnitionSource) -> int:
    """Return how many fires an ignition lights, as far as it says."""
    return lighting.count if isinstance(lighting, Ignition) else 1


def hidden_fires(state: WorldState, world: Rules, keys: Tensor) -> Named:
    """Return single fires of the scenario's ignition, after its head start.

    Args:
        state: The true worlds.
        world: Their rules.
        keys: Of the draws, int64 [B, M].
    """
    lighting, fire, count = world.lighting, world.fire, keys.shape[1]
    one = replace(lighting, count=1) if isinstance(lighting, Ignition) else lighting
    worlds = worlds_of(state, unburned(state, keys, fire), fire)
    fuel = (worlds.landscape.age >= fire.youngest_fuel) & (worlds.alpha > 0.0)
    worlds = lit(worlds.replace(tick=torch.zeros_like(worlds.tick)), one(worlds.key, fuel), fire)
    for _ in range(lighting.head_start):
        worlds = ticked(worlds, fire, world.air, torch.ones_like(worlds.done), worlds.air)
    return held(worlds, count, fire)


def struck(state: WorldState, beliefs: Beliefs, seen: Sightings, doubt: float) -> Beliefs:
    """Return beliefs whose hidden fires are as likely as what is seen leaves them.

    A hidden fire that burns or has burned where a tree is seen is less likely by ``doubt`` for each such cell; one that
    burns where fire is seen is found, and hidden no more.
    """
    code = seen.of(beliefs.hidden.held["cells"][:, None])
    says, gone = is_burning(code), seen.of(beliefs.hidden.held["burned"][:, None])
    there, burns = seen.there[:, :, None], seen.burns[:, :, None]
    wrong = there & ((says & ~burns) | (gone & (seen.code > 0)[:, :, None]))
    right = (there & says & burns).sum(dim=3)
    possible = beliefs.possible * torch.exp(wrong.sum(dim=3) * math.log(doubt))
    surprised = (_unforeseen(beliefs, seen) & seen.burns & seen.there).any(dim=2)
    if not needs_no_sync(surprised.device) or surprised.any():
        beliefs = _taken_up(state, beliefs, possible * right, surprised)
    inside = right > 0
    return beliefs.replace(possible=possible * ~inside, found=beliefs.found + possible * inside)


def _unforeseen(beliefs: Beliefs, seen: Sightings) -> Tensor:
    """Return which of the cells that are seen burn in few members, bool [B, G, n]."""
    return (is_burning(seen.of(cells_of(beliefs))) * beliefs.weights[..., None]).sum(dim=2) < 0.2


def _taken_up(state: WorldState, beliefs: Beliefs, score: Tensor, surprised: Tensor) -> Beliefs:
    """Return beliefs in which a fire that is seen for the first time burns on where it is not seen.

    Each member draws one of the hidden fires by its score, float32 [B, G, M], where the belief was surprised, bool
    [B, G], and burns where that one does.
    """
    groups, count = beliefs.weights.shape[1:]
    draw = uniform(named_key(state.key, NAME), state.step, Stream.IGNITION, (groups, count))
    total = score.cumsum(dim=2)
    pick = torch.searchsorted(total, draw * total[..., -1:], right=True).clamp(max=score.shape[2] - 1).flatten(1)
    takes = (surprised & (total[..., -1] > _LEAST)).repeat_interleave(count, dim=1)[..., None, None]
    members = beliefs.members.held
    laws = tuple(name for name in members if name.startswith("extras."))
    fire = {}
    for name in ("cells", "age", "burned", "stage_age", *laws):
        if name in members:
            hidden = beliefs.hidden.held[name]
            fire[name] = hidden.gather(1, pick[..., None, None].expand(-1, -1, *hidden.shape[2:]))
    burns = (is_burning(fire["cells"]) | fire["burned"]) & is_tree(members["cells"]) & takes
    own = {name: torch.where(burns, plane, members[name]) for name, plane in fire.items()}
    return beliefs.replace(members=beliefs.members.replace(**own))
