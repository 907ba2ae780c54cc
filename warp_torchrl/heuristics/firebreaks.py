"""Firebreaks of teams without water, planned from the present state only."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.distances import distance_to_nearest
from warp_torchrl.world.fires.reach import distance_from_fire
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.presence import those_there
from warp_torchrl.world.world import World

_THREATENED = 0.01
"""Probability to ignite in a tick from which a tree counts as next to the fire: lightning alone stays below it."""
_SLOWEST = 1e-3
"""Of the fire's pace [cells a tick]."""


def cells_to_clear(state: WorldState, world: World, clears: Tensor, effort: float | Tensor) -> Tensor:
    """Return the trees to be cleared, bool [B, H, W]: the smallest ring that the team can finish in time.

    The trees at distance d (``distance_from_fire``) enclose the fire. The team takes the smallest such ring with

        way + effort_d / agents <= ((d - 1) / pace + 1) S - steps since the last tick

    effort_d is that of all trees in the ring. Cleared cells are part of it and take no time, so later states continue
    the same ring. A ring off the map has no trees, so a team that can finish no other clears nothing.

    Args:
        state: The worlds.
        world: Their rules; S is its steps per tick.
        clears: Agents that clear, bool [A], at least one; absent ones do not.
        effort: Steps that one agent takes for a cell of the ring, of all alike or float32 [B, H, W].
    """
    away = distance_from_fire(state, world).to(torch.int64)
    distance = torch.arange(1, max(away.shape[1:]), device=away.device)
    total = torch.zeros(len(away), len(distance) + 2, device=away.device)
    total.scatter_add_(1, away.flatten(1), ((away > 0) * effort).flatten(1).to(total.dtype))
    burning = world.fire.spreads(state)
    ways = distance_to_nearest(state.vehicles.position[:, clears], burning)
    works = those_there(state, clears.expand(len(away), -1))[:, clears]
    farthest = ways.masked_fill(~works, 0).amax(dim=1)
    way = (farthest[:, None] - distance).clamp(min=0)
    needed = way + total[:, 1:-1] / works.sum(dim=1, keepdim=True).clamp(min=1)
    steps = world.steps_per_tick
    left = ((distance - 1) / pace_of_fire(state, world)[:, None] + 1.0) * steps - (state.step % steps)[:, None]
    first = (needed <= left).to(torch.uint8).argmax(dim=1)
    return away == distance[first][:, None, None]


def pace_of_fire(state: WorldState, world: World) -> Tensor:
    """Return the expected pace of the fire, float32 [B] [cells / tick]: the mean chance of the trees beside it."""
    chance = world.forecast(state).ignition_probability.flatten(1)
    beside = chance > _THREATENED
    return ((chance * beside).sum(dim=1) / beside.sum(dim=1).clamp(min=1)).clamp(min=_SLOWEST)
