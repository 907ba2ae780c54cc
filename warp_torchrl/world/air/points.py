"""Points over a map, on which weather by place is interpolated from other grids."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch

from warp_torchrl.world.air.fields import Lattice, WeatherFields
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.resampling import fill, project_bounds, resample
from warp_torchrl.world.weather.table import WeatherTable

_POINTS = 8
"""Points over a map's shorter side at least: one cell of a reanalysis may be wider than the map."""
_MOST_UNKNOWN = 0.25  # share of the points over a map


class PlacedWeather(NamedTuple):
    """Weather by place: its hours with their means over the map, and its fields."""

    table: WeatherTable
    fields: WeatherFields


def window_of(grid: Grid, corner: tuple[int, int], size: tuple[int, int] | None) -> Grid:
    """Return a window of a grid as a grid, the whole one without a size."""
    (row, column), (a, b, left, d, e, top) = corner, grid.transform[:6]
    place = type(grid.transform)(a, b, left + a * column + b * row, d, e, top + d * column + e * row)
    return Grid(grid.shape if size is None else size, grid.crs, place)


def points_over(window: Grid, grids: Sequence[Grid]) -> tuple[Grid, Lattice]:
    """Return points over a map, as far apart as the cells of the finest of some grids, and ``_POINTS`` at least.

    The first lie half a step inside the map. Without the least number that is half a cell of the weather, which on a
    map smaller than such a cell is outside of it.

    Args:
        window: The map.
        grids: The grids.
    """
    joined = min(max(1, round(_cells_to_one(each, window))) for each in grids)
    if window.is_on_earth:  # else nothing is interpolated
        joined = min(joined, max(1, min(window.shape) // _POINTS))
    rows, columns = (max(2, math.ceil(each / joined)) for each in window.shape)
    a, b, left, d, e, top = window.transform[:6]
    place = type(window.transform)(a * joined, b * joined, left, d * joined, e * joined, top)
    middle = (joined - 1) / 2.0
    return Grid((rows, columns), window.crs, place), Lattice((middle, joined), (middle, joined))


def _cells_to_one(grid: Grid, window: Grid) -> float:
    """Return how many of the map's cells lie side by side in one of a raster."""
    west, south, east, north = project_bounds("weather", grid, window.crs)
    across = (east - west) / grid.shape[1] / abs(window.transform[0])
    return min(across, (north - south) / grid.shape[0] / abs(window.transform[4]))


def put(name: str, values: np.ndarray, known: np.ndarray, own: Grid, points: Grid) -> np.ndarray:
    """Return values at the points; beyond the raster's last middles those of the points beside.

    Raises:
        ValueError: If they are known at fewer than three quarters of the points, or one grid alone has a CRS.
    """
    if own.is_on_earth or points.is_on_earth:
        found, there = resample(name, values, known, own, points, "bilinear")
    elif own.differs_in(points):
        raise ValueError(
            f"{name} must have a CRS, and so must the map, to be interpolated, got {own.crs}, {points.crs}"
        )
    else:
        found, there = values, known
    if there.mean() < 1.0 - _MOST_UNKNOWN:
        raise ValueError(f"{name} must be known over the map, it is in {100.0 * there.mean():.0f} % of it")
    return fill(found, there)


def with_means(table: WeatherTable | None, fields: WeatherFields, convergence: float) -> WeatherTable:
    """Return a table of the fields' means over the map, and of the table where they say nothing.

    Args:
        table: The hours, and values that no field has; None: an hour from one to the next.
        fields: The weather by place.
        convergence: Angle from true north to the grid's north, clockwise [degrees].
    """
    winds, moistures = fields.means
    bearing = (torch.rad2deg(torch.atan2(-winds[:, 0], -winds[:, 1])) + convergence) % 360.0
    known = {
        name: column for name, column in zip(MOISTURES, moistures.unbind(1), strict=True) if not column.isnan().any()
    }
    of_wind = {"wind_speed": winds.square().sum(1).sqrt(), "wind_bearing": bearing, "wind_height": "10m"}
    if table is None:
        return WeatherTable(hours=torch.arange(len(winds), dtype=torch.float32), **of_wind, **known)  # type: ignore[arg-type]
    return replace(table, **of_wind, **known)  # type: ignore[arg-type]
