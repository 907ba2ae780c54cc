"""Places and worth of assets: of a raster, of a list, and drawn."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.start import first_free

Points = tuple[tuple[float, float, float], ...]
"""(row, column, worth) of each asset."""


def worth_of_assets(state: WorldState, points: Points, houses: int) -> Tensor:
    """Return what each cell is worth before the fire, float32 [B, H, W].

    The sum of the landscape's layer ``assets``, points and houses; without all of them 1 for each tree.

    Args:
        state: The worlds at the start of an episode.
        points: In rows and columns of the landscape's source [cells].
        houses: How many are drawn over the dry ground, each worth 1.
    """
    assets = state.landscape.layer("assets")
    if assets is None and not points and not houses:
        return state.initial.to(torch.float32)
    worth = torch.zeros_like(state.alpha) if assets is None else assets.clamp(min=0.0)
    worth = worth + _of_points(state, points) if points else worth
    return worth + _of_houses(state, houses) if houses else worth


def _of_points(state: WorldState, points: Points) -> Tensor:
    none, (height, width) = torch.zeros_like(state.alpha), state.cells.shape[1:]
    told = numbers(tuple(number for point in points for number in point), none.device).view(-1, 3)
    place = told[:, :2].floor().to(torch.int64).expand(len(none), -1, -1)
    if state.landscape.corner is not None:
        place = place - state.landscape.corner[:, None]
    row, column = place.unbind(-1)
    on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    cell = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
    return none.flatten(1).scatter_add(1, cell, told[:, 2] * on_map).view_as(none)


def _of_houses(state: WorldState, houses: int) -> Tensor:
    none, (height, width) = torch.zeros_like(state.alpha), state.cells.shape[1:]
    u = uniform(named_key(state.episode_key, "values"), 0, Stream.NAMED, (height, width))
    dry = state.cover != int(Cover.LAKE)
    place = first_free((u * (1 << 24)).to(torch.int64), ~dry, min(houses, height * width))
    cell = place[..., 0] * width + place[..., 1]
    return none.flatten(1).scatter(1, cell, 1.0).view_as(none) * dry
