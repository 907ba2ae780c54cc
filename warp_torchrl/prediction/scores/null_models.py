"""Null models: the circle, and ellipses of the mean wind. A law of fire must score better than all.

They start at the ignition and grow over fuel alone, without fuels, slopes or hours, until they have a number of cells.
The circle and the plain ellipse burn what lies nearest, over rock and water; the ellipse that walks burns what can be
reached over fuel.
"""

import math
from collections.abc import Iterator

import torch
from torch import Tensor

from warp_torchrl.prediction.scores.arrivals import first_cells
from warp_torchrl.world.law.travel import NEVER

_KMH = 3.6  # kilometres an hour in a metre a second
_MOVES = [
    (row, column)
    for row in range(-2, 3)
    for column in range(-2, 3)
    if max(abs(row), abs(column)) == 1 or {abs(row), abs(column)} == {1, 2}
]
"""Steps (rows south, columns east) to sixteen neighbours: those of a king and of a knight."""


def circle_cells(lit: Tensor, fuel: Tensor, cells: int) -> Tensor:
    """Return the cells of fuel that lie nearest to the ignition, bool [H, W].

    Args:
        lit: Where the fire starts, bool [H, W]; their middle is where it starts from.
        fuel: Cells that can burn, bool [H, W].
        cells: How many.
    """
    return _nearest(lit, fuel, cells, torch.zeros(2), 0.0)


def ellipse_cells(lit: Tensor, fuel: Tensor, cells: int, wind: Tensor) -> Tensor:
    """Return the cells of fuel that an ellipse reaches first, bool [H, W].

    Its focus is the ignition, its head points downwind: the distance is |v| - e n . v, e = sqrt(1 - 1 / LB^2).

    Args:
        lit: As in ``circle_cells``.
        fuel: As in ``circle_cells``.
        cells: How many.
        wind: (u east, v north) of the air's motion at 10 m, float32 [2] [m/s].
    """
    return _nearest(lit, fuel, cells, *_heading(wind))


def walking_ellipse_cells(lit: Tensor, fuel: Tensor, cells: int, wind: Tensor) -> Tensor:
    """Return the cells of fuel that an ellipse reaches first by steps over fuel, bool [H, W].

    A step v to one of 16 neighbours takes |v| - e n . v. A knight's step needs one of the two cells that it crosses.

    Args:
        lit: As in ``circle_cells``; each of these cells starts the fire.
        fuel: As in ``circle_cells``.
        cells: How many; fewer where fewer can be reached.
        wind: As in ``ellipse_cells``.
    """
    heading, focus = _heading(wind)
    costs = [math.hypot(row, column) - focus * float(column * heading[0] - row * heading[1]) for row, column in _MOVES]
    reach = torch.where(lit & fuel, 0.0, NEVER)
    ways = list(_ways(fuel))
    while True:
        before = reach.clone()
        for (to, start), cost, way in zip(_spans(reach.shape), costs, ways, strict=True):
            reach[to] = torch.where(way, torch.minimum(reach[to], reach[start] + cost), reach[to])
        if torch.equal(before, reach):
            return first_cells(reach, cells)


def length_to_breadth(speed: float) -> float:
    """Return LB = 1 + 8.729 (1 - exp(-0.030 w))^2.155, w in km/h (Forestry Canada 1992, ST-X-3, eq. 79).

    Args:
        speed: Of the wind at 10 m [m/s].
    """
    return float(1.0 + 8.729 * (-math.expm1(-0.030 * _KMH * speed)) ** 2.155)


def mean_wind(winds: Tensor, minutes: Tensor) -> Tensor:
    """Return the mean of winds as vectors, weighted by duration, float32 [2] [m/s].

    Args:
        winds: float32 [T, 2] [m/s].
        minutes: float32 [T].
    """
    return (winds * minutes[:, None]).sum(0) / minutes.sum()


def _heading(wind: Tensor) -> tuple[Tensor, float]:
    """Return where an ellipse points, float32 [2], and its eccentricity."""
    speed = float(wind.square().sum().sqrt())
    return wind / max(speed, 1e-9), math.sqrt(1.0 - length_to_breadth(speed) ** -2)


def _nearest(lit: Tensor, fuel: Tensor, cells: int, heading: Tensor, focus: float) -> Tensor:
    row, column = lit.nonzero().to(torch.float32).mean(0)
    height, width = lit.shape
    north = row - torch.arange(height, dtype=torch.float32)[:, None]
    east = torch.arange(width, dtype=torch.float32) - column
    distance = torch.hypot(east.expand(height, width), north.expand(height, width))
    distance = distance - focus * (east * heading[0] + north * heading[1])
    return first_cells(torch.where(fuel, distance, NEVER), cells)


def _spans(shape: torch.Size) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """Yield of each move the cells where it ends and where it begins."""
    for move in _MOVES:
        ends, begins = [], []
        for step, size in zip(move, shape, strict=True):
            ends.append(slice(max(0, step), size + min(0, step)))
            begins.append(slice(max(0, -step), size + min(0, -step)))
        yield (ends[0], ends[1]), (begins[0], begins[1])


def _ways(fuel: Tensor) -> Iterator[Tensor]:
    """Yield the cells where each move may end, bool, of those of ``_spans``."""
    for (row, column), (to, start) in zip(_MOVES, _spans(fuel.shape), strict=True):
        way = fuel[to] & fuel[start]
        if max(abs(row), abs(column)) == 2:
            along = (row // 2, 0) if abs(row) == 2 else (0, column // 2)  # the crossed cells: straight, and diagonal
            sides = along, (along[0] or row, along[1] or column)
            crossed = [
                fuel[start[0].start + south : start[0].stop + south, start[1].start + east : start[1].stop + east]
                for south, east in sides
            ]
            way = way & (crossed[0] | crossed[1])
        yield way
