"""Passing of a fire through each cell: its rate, intensity and flame length on arrival.

The rate of spread of a front, across itself, is 1 / |grad T| of its arrival times T. Byram's intensity goes with that
rate along the whole perimeter (Catchpole, de Mestre and Gill 1982), and the flame length with its power of 0.46 (Byram
1959):

    I = I_head R / R_head,    L = L_head (R / R_head)^0.46
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.geometry import neighbours
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law.travel import NEVER

_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class HeadBehaviour:
    """Behaviour of the heads of fires in some cells, in the weather of their arrival; float32 of one shape."""

    head: Tensor  # rate of spread of the head [m/min]
    backing: Tensor  # and of the rear
    intensity: Tensor  # fireline intensity at the head [kW/m]
    flame_length: Tensor  # at the head [m]
    kind: Tensor | None = None  # of fire: 0 surface, 1 passive crown fire, 2 active; None where crowns are not known


def passing(steep: Tensor, pace: Tensor, then: HeadBehaviour, cell_size: float) -> tuple[Tensor, ...]:
    """Return rate [m/min], intensity [kW/m] and flame length [m] of fires on arrival, float32 of one shape.

    Where crowns are known, then whether the fire was in them, and whether as active crown fire, 0 or 1: as at the head
    in the weather of the arrival.

    The rate is held between those of the rear and of the head in the weather of the arrival: near its start a fire is
    smaller than a cell, and differences between cells do not give its rate.

    Args:
        steep: |grad T| [minutes a cell], see ``steepness``.
        pace: Factor on the fire's times.
        then: Behaviour of the heads.
        cell_size: Side of a cell [m].
    """
    rate = cell_size / steep.clamp(min=_LEAST)
    rate = torch.minimum(torch.maximum(rate, then.backing / pace), then.head / pace)
    share = rate / then.head.clamp(min=_LEAST)
    found = rate, then.intensity * share, then.flame_length * share.pow(0.46)
    return found if then.kind is None else (*found, (then.kind > 0.0).to(rate.dtype), (then.kind > 1.0).to(rate.dtype))


def head_behaviour(spread: Spread) -> HeadBehaviour:
    """Return the behaviour of heads, without the kind of fire; the rear has R_head (1 - e) / (1 + e) (Richards 1990).

    e is the eccentricity of the ellipse.
    """
    focus = (1.0 - spread.length_to_breadth.pow(-2)).clamp(min=0.0).sqrt()
    backing = spread.head * (1.0 - focus) / (1.0 + focus)
    return HeadBehaviour(spread.head, backing, spread.intensity, spread.flame_length)


def steepness(arrival: Tensor) -> Tensor:
    """Return |grad T| of arrival times, float32 [B, H, W] [minutes a cell], from the cells that came before."""
    return steepness_from(neighbours(arrival, NEVER), arrival)


def steepness_from(around: Tensor, arrival: Tensor) -> Tensor:
    """Return |grad T| in some cells, float32, shape of their arrival times [minutes a cell].

    The steeper of two estimates: of the differences to the earlier neighbour in the row and in the column, and of that
    to the earliest across a corner. Neither is over the true one where T is linear, and one of them is right where fire
    comes along a row, a column or a diagonal.

    Args:
        around: Arrival times of the neighbours, float32 [8, ...] [minutes], directions as ``geometry.DIRECTIONS``.
        arrival: Arrival times, float32 [...] [minutes].
    """
    north, north_east, east, south_east, south, south_west, west, north_west = around
    row, column = torch.minimum(west, east), torch.minimum(north, south)
    above, below = torch.minimum(north_west, north_east), torch.minimum(south_west, south_east)
    straight = torch.hypot((arrival - row).clamp(min=0.0), (arrival - column).clamp(min=0.0))
    return torch.maximum(straight, (arrival - torch.minimum(above, below)).clamp(min=0.0) * 0.5**0.5)
