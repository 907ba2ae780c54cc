"""Worth that lies ahead of a fire."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import neighbour_in, slices
from warp_torchrl.world.law.arrivals import metric
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import rate_from
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

WITHIN = 60.0
"""Minutes after which what burns later counts for half in each cell of its way."""


def worth_ahead(state: WorldState, world: World, worth: Tensor, within: float = WITHIN) -> Tensor:
    """Return the most that fire in each cell would reach, less for what it reaches later.

        V(c) = max over neighbours n of k max(w(n), V(n)),   k = T / (T + F)

    F is the time that the fire takes from c to n under law ``rate``, T is ``within``; under the other laws k is n's
    flammability. What cannot ignite stops it. It looks as far as half of the map's longer side. The measure is ours.

    Args:
        state: The worlds.
        world: Their rules.
        worth: w, float32 [B, H, W].
        within: T [minutes].

    Returns:
        V, float32 [B, H, W].
    """
    fuel = world.fire.can_ignite(state)
    comes = [neighbour_in(direction, each * fuel) for direction, each in enumerate(_kept(state, world, within))]
    beyond = pad(worth, (1, 1, 1, 1))  # the more of worth and V, with a margin
    inside, around = beyond[:, 1:-1, 1:-1], slices(beyond)
    ahead, one = torch.empty_like(worth), torch.empty_like(worth)
    for _ in range(max(worth.shape[1:]) // 2):  # over the length of ways
        torch.mul(comes[0], around[0], out=ahead)
        for there, neighbour in zip(comes[1:], around[1:], strict=True):
            torch.maximum(ahead, torch.mul(there, neighbour, out=one), out=ahead)
        torch.maximum(worth, ahead, out=inside)
    return ahead


def _kept(state: WorldState, world: World, within: float) -> list[Tensor]:
    """Return k of the way into each cell, from the neighbour that has it in each of the eight directions."""
    if not isinstance(world.fire, RateFire):
        return [state.alpha] * 8
    rates = metric(state.ground, state.air)
    into = [within * rate_from((direction + 4) % 8, rates) for direction in range(8)]
    return [each / (each + 1.0) for each in into]
