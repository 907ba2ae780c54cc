"""Where teams without water cut firebreaks, by the present state alone."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.distances import distance_to_nearest
from warp_torchrl.world.fires.reach import way_of_fire
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

_THREATENED = 0.01
"""Probability to ignite in a tick from which a tree counts as next to the fire: lightning alone stays below it."""
_SLOWEST = 1e-3
"""Of the fire's pace [cells a tick]."""


def cells_to_clear(state: WorldState, world: World, clears: Tensor, effort: float) -> Tensor:
    """Return the trees to be cleared, bool [B, H, W]: those to which fire has the same way, the shortest in time.

    The trees to which fire has d cells to go (``way_of_fire``) shut it in. The team takes the smallest such ring that
    it can finish in time:

        way + effort n_d / agents <= ((d - 1) / pace + 1) S - steps since the last tick

    n_d trees are in the ring. What was cleared is part of it and takes no time, so a later state goes on with it. A
    ring off the map has no trees, so a team that can finish no other clears nothing.

    Args:
        state: The worlds.
        world: Their rules; S is its steps to a tick.
        clears: Which agents clear, bool [A], one at least.
        effort: Steps that one agent takes for a cell of the ring.
    """
    away = way_of_fire(state, world).to(torch.int64)
    distance = torch.arange(1, max(away.shape[1:]), device=away.device)
    count = torch.zeros(len(away), len(distance) + 2, device=away.device)
    count.scatter_add_(1, away.flatten(1), (away > 0).flatten(1).to(count.dtype))
    burning = world.fire.spreads(state)
    farthest = distance_to_nearest(state.vehicles.position[:, clears], burning).amax(dim=1)
    way = (farthest[:, None] - distance).clamp(min=0)
    needed = way + effort * count[:, 1:-1] / clears.sum()
    steps = world.steps_per_tick
    left = ((distance - 1) / pace_of_fire(state, world)[:, None] + 1.0) * steps - (state.step % steps)[:, None]
    first = (needed <= left).to(torch.uint8).argmax(dim=1)
    return away == distance[first][:, None, None]


def pace_of_fire(state: WorldState, world: World) -> Tensor:
    """Return how far the fire is expected to go, float32 [B] [cells a tick]: the mean chance of the trees beside it."""
    chance = world.forecast(state).ignition_probability.flatten(1)
    beside = chance > _THREATENED
    return ((chance * beside).sum(dim=1) / beside.sum(dim=1).clamp(min=1)).clamp(min=_SLOWEST)
