"""The way to water, as agents with tanks are told it: what a map shows that a crew carries."""

import torch
from torch import Tensor

from warp_torchrl.entries import Part
from warp_torchrl.world.arrays.counting import counting
from warp_torchrl.world.arrays.distances import chebyshev_distance
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.supply import where_tanks_fill
from warp_torchrl.world.world import World

WATER = (Part("vector", ("water_east", "water_north")), Part("scalar", ("water_distance",)))
"""Entries of ``status`` that tell the way to water, see ``way_to_water``."""
_SCALE = 32.0
"""Distance that is shown as 1 [cells]."""


def way_to_water(state: WorldState, world: World) -> Tensor:
    """Return the direction and the distance of the nearest cell where each agent's tank fills, float32 [B, A, 3].

    The direction is the mean of those to all cells that are as near, over their distance, in -1..1; the distance is
    Chebyshev's, over 32 cells and at most 3. Zeros at such a cell, and in teams whose tanks need no water.
    """
    place = state.vehicles.position
    if not world.team.tank:
        return torch.zeros(*place.shape[:-1], 3, device=place.device)
    distance = chebyshev_distance(place, where_tanks_fill(state))
    least = distance.flatten(2).amin(-1)
    is_nearest = (distance == least[..., None, None]).to(torch.float32)
    count = is_nearest.sum((2, 3))
    row, column = (
        (is_nearest.sum(3 - axis) * counting(state.cells.shape[1 + axis], place)).sum(-1) / count for axis in (0, 1)
    )
    steps = least.to(torch.float32)
    gap = torch.stack((column - place[..., 1], place[..., 0] - row), dim=-1) / steps.clamp(min=1.0)[..., None]
    return torch.cat((gap, (steps / _SCALE).clamp(max=3.0)[..., None]), dim=-1)
