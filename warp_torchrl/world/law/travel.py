"""The law of a fire with rates of spread: when it reaches each cell, in plain tensor operations.

A fire that spreads freely grows into an ellipse with its origin at a focus. From a point it reaches a place at v after

    F(v) = a |v| - w . v,    a = 1 / (R (1 - e)),    w = a e n

R is the head's rate, n the unit vector where it goes, e = sqrt(1 - 1 / LB^2) (Richards 1990; LB: length to breadth).
So T = t + w . x obeys the isotropic eikonal equation |grad T| = a (a Randers metric). An ellipse of any length is a
circle that the wind carries along. The time of a cell follows from its eight neighbours in two ways. The earlier holds:

* ``from_edges``: the fire comes over the edge between two adjacent neighbours. T is linear on the edge (Tsitsiklis
  1995; Sethian and Vladimirsky 2003). This is right for a straight front, and for a start from a neighbour.
* ``along_ray``: the fire comes straight from an origin, the cell where its neighbours had it from. It has the mean
  slowness of the neighbours' ways. This is right for the tip of a young fire, which is narrower than a cell. Behind an
  obstacle a cell beside the obstacle is the origin.

A narrow head passes between two cells before it reaches either. So times go ahead of the fire: see ``kindling``.

Times are in minutes, lengths in cells. The functions read stacks of the neighbours of any cells, [8, ...], directions
in the order of ``geometry.DIRECTIONS``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.geometry import DIRECTIONS

NEVER = 1e9
"""A time that does not come [minutes]."""
NOWHERE = -1
"""The origin of a fire that came over an edge, from no one cell."""
ROUNDING = 2e-4
"""Share of a cell's crossing by which rounding may lengthen a straight way."""
Metric = tuple[Tensor, Tensor, Tensor]
"""a, w_east and w_north of the fire in some cells, float32 of one shape [minutes a cell]."""
_SOUTH, _EAST = zip(*DIRECTIONS, strict=True)
_BESIDE = (0, 2, 2, 4, 4, 6, 6, 0)
_ACROSS = (1, 1, 3, 3, 5, 5, 7, 7)
"""Directions of the two ends of the eight edges about a cell: beside it, and across its corner."""
_WHOLE = 1.0 / math.sqrt(2.0) - 1e-5
_LEAST = 1e-9
_AHEAD = 0.08
"""Share of a, for ``kindling``: 22.5 degrees off the head a cell takes 0.076 a e more than at the head."""


def travel(head: Tensor, direction: Tensor, length_to_breadth: Tensor, cell_size: float) -> Tensor:
    """Return a, w_east and w_north of the fire in each cell, float32 [B, 3, H, W] [minutes a cell].

    Args:
        head: R, float32 [B, H, W] [m/min]; 0 where nothing burns, which gives ``NEVER``.
        direction: Where the head goes, float32 [B, H, W] [degrees clockwise from grid north].
        length_to_breadth: LB, float32 [B, H, W], 1 or more.
        cell_size: Side of a cell [m].
    """
    focus = torch.sqrt((1.0 - length_to_breadth.pow(-2)).clamp(min=0.0))
    slowness = (cell_size / (head * (1.0 - focus)).clamp(min=_LEAST)).clamp(max=NEVER)
    angle = torch.deg2rad(direction)
    return torch.stack((slowness, slowness * focus * angle.sin(), slowness * focus * angle.cos()), dim=1)


def duration(metric: Metric, east: Tensor, north: Tensor) -> Tensor:
    """Return F of a way, float32 [minutes].

    Args:
        metric: a, w_east, w_north [minutes a cell].
        east: Its part to the east [cells].
        north: Its part to the north [cells].
    """
    slowness, drift_east, drift_north = metric
    return slowness * torch.sqrt(east * east + north * north) - drift_east * east - drift_north * north


def rate_from(direction: int, metric: Metric) -> Tensor:
    """Return 1 / F into cells from their neighbours in a direction, float32, shape of the metric's [cells/min]."""
    row, column = DIRECTIONS[direction]
    east, north = torch.full_like(metric[0], -column), torch.full_like(metric[0], row)
    return 1.0 / duration(metric, east, north).clamp(min=1e-9)


@dataclass(frozen=True, eq=False)
class Places:
    """Some cells of maps of one size."""

    row: Tensor  # int32 [...]
    column: Tensor  # int32 [...]
    width: int  # columns of the maps
    time_of: Callable[[Tensor], Tensor]
    """Returns when the fire reached other cells of the same maps, given their flat index in the map, int32 [...]."""


def arrival(times: Tensor, origins: Tensor, metric: Metric, at: Places) -> tuple[Tensor, Tensor]:
    """Return when the fire reaches some cells, and the cell that it comes from on a straight way.

    Args:
        times: When it reaches each neighbour, float32 [8, ...] [minutes]; ``NEVER`` where it does not.
        origins: Flat index of each neighbour's origin, int32 [8, ...], or ``NOWHERE``.
        metric: Of the cells.
        at: The cells.

    Returns:
        float32 [...] [minutes], ``NEVER`` where it does not come, and int32 [...] like ``origins``.
    """
    time, nearer, farther, from_one = from_edges(times, metric)
    handed = origins.gather(0, nearer[None])[0]
    handed = torch.where(handed >= 0, handed, origins.gather(0, farther[None])[0])
    straight = along_ray(times, origins, handed, metric, at)
    on_ray = straight <= time + ROUNDING * metric[0]
    neighbour = _neighbour(nearer, at)
    time = torch.where(on_ray, straight, time)
    origin = torch.where(on_ray, handed, torch.where(from_one, neighbour, NOWHERE))
    comes = time < NEVER / 2
    return torch.where(comes, time, NEVER), torch.where(comes, origin, NOWHERE)


def kindling(times: Tensor, slowness: Tensor) -> Tensor:
    """Return when the neighbours of cells get times, some minutes before the fire comes, float32 [...] [minutes].

    Args:
        times: When it reaches the cells, float32 [...] [minutes].
        slowness: a of the cells, float32 [...] [minutes a cell].
    """
    return times - _AHEAD * slowness


def differ(before: Metric, after: Metric) -> Tensor:
    """Return where the rates of two weathers differ, bool [...]."""
    return (before[0] != after[0]) | (before[1] != after[1]) | (before[2] != after[2])


def least_ratio(before: Metric, after: Metric) -> Tensor:
    """Return the least ratio of F in one weather to F in the weather before, over all directions, float32 [...].

        rho = a' / a (1 - e'^2) / (B + sqrt(B^2 - (1 - e^2) (1 - e'^2))),   B = 1 - e . e',   e = w / a

    It is the lower root of (a' - rho a)^2 = |w' - rho w|^2; 1 exactly in the same weather.
    """
    (east, north), (new_east, new_north) = ((m[1] / m[0], m[2] / m[0]) for m in (before, after))
    old, new = 1.0 - (east * east + north * north), 1.0 - (new_east * new_east + new_north * new_north)
    both = 1.0 - (east * new_east + north * new_north)
    return after[0] / before[0] * new / (both + torch.sqrt((both * both - old * new).clamp(min=0.0)))


def since(times: Tensor, now: Tensor | float, ratio: Tensor) -> Tensor:
    """Return the times from which cells spread fire in another weather, float32 [...] [minutes].

    A cell has sent the fire a way that took it the minutes since then. In the other weather the same way takes F' / F
    times as long, and at least ``ratio`` times. So fire comes nowhere before ``now``.

    Args:
        times: When the fire reached them, float32 [...] [minutes].
        now: When the weather changes.
        ratio: ``least_ratio``, the least of the cells about that can ignite, float32 [...].
    """
    return times + (now - times) * (1.0 - ratio)


def until(times: Tensor, now: Tensor | float, around: Tensor, before: Metric, after: Metric) -> Tensor:
    """Return when the fire reaches cells that it is near, in another weather, float32 [...] [minutes].

        t' = now + (t - now) min_d F'_d / (t - t_d) / min_d F_d / (t - t_d)

    Each neighbour d burns before the cell. The front lies (t - now) / (t - t_d) of the way back to it, and the rest of
    the way takes F' in place of F. The time is never before ``now``, and is t in the same weather.

    Args:
        times: When it would have, float32 [...] [minutes], after ``now``.
        now: When the weather changes.
        around: The same of the neighbours, float32 [8, ...]; ``NEVER`` where it does not come.
        before: Of the cells.
        after: The same from now on.
    """
    lasts = torch.where(around < times, times - around, _LEAST)
    old, new = ((_from_each(metric, times) / lasts).amin(0) for metric in (before, after))
    changed = times + (times - now) * (new / old - 1.0)
    return torch.where(changed < NEVER / 2, changed, NEVER)


def from_edges(times: Tensor, metric: Metric) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return when fire comes over an edge between two adjacent neighbours, or from one of them.

        T = min over s in [0, 1] of (1 - s) T_a + s T_b + a sqrt(1 + s^2)

    of the neighbour a beside the cell and b across its corner, at s / sqrt(1 + s^2) = (T_a - T_b) / a.

    Returns:
        The time, float32 [...] [minutes]; the directions of the nearer and of the farther neighbour, int64 [...] each;
        and whether the fire comes from the nearer one alone, bool [...].
    """
    slowness = metric[0]
    carried = times - _drift(metric, times)
    beside, across = (carried.index_select(0, _kept(ends, times.device)) for ends in (_BESIDE, _ACROSS))
    sine = ((beside - across) / slowness).clamp(0.0, _WHOLE)
    part = torch.where(sine >= _WHOLE, 1.0, sine / torch.sqrt(1.0 - sine * sine))
    time = (1.0 - part) * beside + part * across + slowness * torch.sqrt(1.0 + part * part)
    time, edge = time.min(dim=0)
    part = part.gather(0, edge[None])[0]
    beside, across = _table(_BESIDE, edge), _table(_ACROSS, edge)
    nearer, farther = torch.where(part < 0.5, beside, across), torch.where(part < 0.5, across, beside)
    return time, nearer, farther, (part == 0.0) | (part == 1.0)


def along_ray(times: Tensor, origins: Tensor, origin: Tensor, metric: Metric, at: Places) -> Tensor:
    """Return when the fire comes straight from the origin of the neighbours on the way.

    Their mean slowness from the origin, t / F, is that of the way to the edge between them:

        t = t_o + F(x - o) (m (1 - 1 / n) + 1 / n),   m = (1 - s) (t_a - t_o) / F(a - o) + s (t_b - t_o) / F(b - o)

    n is the larger of the distances from the origin in rows and columns, and s n is the other. The way passes nearer to
    one of the neighbours, b where s is over a half. Where the origin is that neighbour's alone, m is that of it: a cell
    does not stop a fire that clips less than half of it.

    Args:
        times: See ``arrival``.
        origins: See ``arrival``.
        origin: Of the cells, int32 [...], or ``NOWHERE``.
        metric: See ``arrival``.
        at: The cells.

    Returns:
        float32 [...] [minutes]; ``NEVER`` where there is no such way.
    """
    south, east = at.row - origin // at.width, at.column - origin % at.width
    steps, sideways = torch.maximum(south.abs(), east.abs()), torch.minimum(south.abs(), east.abs())
    beside, across = _towards(south, east)
    begun = at.time_of(origin.clamp(min=0))
    s, share = sideways / steps.clamp(min=1), 1.0 / steps.clamp(min=1)

    def weighed(part: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        """Return the part of a neighbour in the mean, and that times its slowness."""
        down, right = _table(_SOUTH, direction), _table(_EAST, direction)
        way = duration(metric, (east + right).to(torch.float32), -(south + down).to(torch.float32))
        part = part * (origins.gather(0, direction[None])[0] == origin)
        return part, part * (times.gather(0, direction[None])[0] - begun) / way.clamp(min=_LEAST)

    (part_a, slow_a), (part_b, slow_b) = weighed(1.0 - s, beside), weighed(s, across)
    parts = part_a + part_b
    mean = (slow_a + slow_b) / parts.clamp(min=0.5)
    whole = duration(metric, east.to(torch.float32), -south.to(torch.float32))
    time = begun + whole * (mean * (1.0 - share) + share)
    return torch.where((parts >= 0.5) & (origin >= 0) & (steps > 1) & (begun < NEVER / 2), time, NEVER)


def _from_each(metric: Metric, like: Tensor) -> Tensor:
    """Return F into cells from each neighbour, float32 [8, ...] [minutes]."""
    east, north = (_part(part, like[None]) for part in (0, 1))
    return duration(metric, -east, -north)


def _drift(metric: Metric, times: Tensor) -> Tensor:
    """Return w . (x - y) of each neighbour's place y, float32 [8, ...] [minutes]."""
    east, north = (_part(part, times) for part in (0, 1))
    return -(metric[1] * east + metric[2] * north)


def _towards(south: Tensor, east: Tensor) -> tuple[Tensor, Tensor]:
    """Return the directions of the neighbours beside and across on the way back, int64 [...] each."""
    down, right = (south > 0).to(torch.int64), (east > 0).to(torch.int64)
    beside = torch.where(south.abs() >= east.abs(), 4 - 4 * down, 2 + 4 * right)
    across = torch.where(south > 0, 1 + 6 * right, 3 + 2 * right)
    return beside, across


def _neighbour(direction: Tensor, at: Places) -> Tensor:
    """Return the flat index of each cell's neighbour in a direction, int32 [...]."""
    row, column = at.row + _table(_SOUTH, direction), at.column + _table(_EAST, direction)
    return (row * at.width + column).to(torch.int32)


def _table(values: tuple[int, ...], index: Tensor) -> Tensor:
    """Return the value of each index, int32, shape of the index."""
    table = _kept(values, index.device)
    return table.index_select(0, index.flatten()).view(index.shape)


def _part(axis: int, like: Tensor) -> Tensor:
    """Return by how much each neighbour lies east (0) or north (1), float32 [8, 1, ...] [cells]."""
    values = _kept(_EAST, like.device) if axis == 0 else -_kept(_SOUTH, like.device)
    return values.to(torch.float32).view(8, *(1 for _ in like.shape[1:]))


@kept(32)
def _kept(values: tuple[int, ...], device: torch.device) -> Tensor:
    return torch.tensor(values, dtype=torch.int32, device=device)
