"""Places and worth of assets: of a raster, of a list, and drawn."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.start import first_free

Downwind = tuple[float, float]
"""Least and greatest distance down the wind from the fire [cells]."""
Points = tuple[tuple[float, float, float], ...]
"""(row, column, worth) of each asset."""


def has_assets(state: WorldState, points: Points, houses: int) -> bool:
    """Return whether the worlds have assets; without any each tree is worth 1."""
    return bool(points or houses or state.landscape.layer("assets") is not None)


def worth_of_assets(state: WorldState, points: Points, houses: int, downwind: Downwind | None = None) -> Tensor:
    """Return what each cell is worth before the fire, float32 [B, H, W].

    The sum of the landscape's layer ``assets``, points and houses; without all of them 1 for each tree.

    Args:
        state: The worlds at the start of an episode.
        points: In rows and columns of the landscape's source [cells].
        houses: How many are drawn over the dry ground, each worth 1.
        downwind: How far down the wind from the fire these stand; None: anywhere.
    """
    if not has_assets(state, points, houses):
        return state.initial.to(torch.float32)
    assets = state.landscape.layer("assets")
    worth = torch.zeros_like(state.alpha) if assets is None else assets.clamp(min=0.0)
    worth = worth + _of_points(state, points) if points else worth
    return worth + _of_houses(state, houses, downwind) if houses else worth


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


def _of_houses(state: WorldState, houses: int, downwind: Downwind | None) -> Tensor:
    none, (height, width) = torch.zeros_like(state.alpha), state.cells.shape[1:]
    u = uniform(named_key(state.episode_key, "values"), 0, Stream.NAMED, (height, width))
    dry = state.cover != int(Cover.LAKE)
    order = (u * (1 << 24)).to(torch.int64)
    if downwind is not None:
        order = order + (1 << 24) * ~is_downwind(state, *downwind)
    place = first_free(order, ~dry, min(houses, height * width))
    cell = place[..., 0] * width + place[..., 1]
    return none.flatten(1).scatter(1, cell, 1.0).view_as(none) * dry


def is_downwind(state: WorldState, least: float, greatest: float) -> Tensor:
    """Return the cells that lie down the wind from the middle of the fire, within 45 degrees, bool [B, H, W].

    Args:
        state: The worlds, in whose mean wind of now that is.
        least: Distance along the wind [cells].
        greatest: The same.
    """
    fire = is_burning(state.cells)
    rows, columns = (torch.arange(side, dtype=torch.float32, device=fire.device) for side in fire.shape[1:])
    count = fire.flatten(1).sum(dim=1).clamp(min=1)[:, None, None]
    south = rows[:, None] - (fire * rows[:, None]).flatten(1).sum(dim=1)[:, None, None] / count
    east = columns - (fire * columns).flatten(1).sum(dim=1)[:, None, None] / count
    wind = state.wind.mean(dim=(2, 3))[..., None, None]
    speed = wind.square().sum(dim=1, keepdim=True).sqrt()
    to_east, to_north = (wind / speed.clamp(min=1e-6)).unbind(1)
    along, across = east * to_east - south * to_north, east * to_north + south * to_east
    return (along >= least) & (along <= greatest) & (across.abs() <= along)
