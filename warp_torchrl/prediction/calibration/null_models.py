"""Null models: the circle, and the ellipse of the mean wind. A law of fire must score better than both.

Both start at the ignition and grow over fuel alone, without fuels, slopes or hours, until they have a number of cells.
"""

import math

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.scores import first_cells
from warp_torchrl.world.law.travel import NEVER

_KMH = 3.6  # kilometres an hour in a metre a second


def circle_cells(lit: Tensor, fuel: Tensor, cells: int) -> Tensor:
    """Return the cells of fuel that lie nearest to the ignition, bool [H, W].

    Args:
        lit: Where the fire starts, bool [H, W]; their middle is where it starts from.
        fuel: Cells that can burn, bool [H, W].
        cells: How many.
    """
    return _grown(lit, fuel, cells, torch.zeros(2), 0.0)


def ellipse_cells(lit: Tensor, fuel: Tensor, cells: int, wind: Tensor) -> Tensor:
    """Return the cells of fuel that an ellipse reaches first, bool [H, W].

    Its focus is the ignition, its head points downwind: the distance is |v| - e n . v, e = sqrt(1 - 1 / LB^2).

    Args:
        lit: As in ``circle_cells``.
        fuel: As in ``circle_cells``.
        cells: How many.
        wind: (u east, v north) of the air's motion at 10 m, float32 [2] [m/s].
    """
    speed = float(wind.square().sum().sqrt())
    focus = math.sqrt(1.0 - length_to_breadth(speed) ** -2)
    return _grown(lit, fuel, cells, wind / max(speed, 1e-9), focus)


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


def _grown(lit: Tensor, fuel: Tensor, cells: int, heading: Tensor, focus: float) -> Tensor:
    row, column = lit.nonzero().to(torch.float32).mean(0)
    height, width = lit.shape
    north = row - torch.arange(height, dtype=torch.float32)[:, None]
    east = torch.arange(width, dtype=torch.float32) - column
    distance = torch.hypot(east.expand(height, width), north.expand(height, width))
    distance = distance - focus * (east * heading[0] + north * heading[1])
    return first_cells(torch.where(fuel, distance, NEVER), cells)
