"""How wind and ground help a fire in each direction.

The direction of travel is from the burning cell, the source, to the cell that may ignite, the target. Wind is read at
the source; the slope is that between the two.
"""

import math

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.geometry import DIRECTIONS, DISTANCES, unit_vectors
from warp_torchrl.world.behaviour.fbp import fine_fuel_effect, spread_index
from warp_torchrl.world.behaviour.fbp_fuels import FUEL_TYPES

_KM_PER_HOUR = 3.6  # of one m/s; the Canadian system's winds are in km/h
_ALONE = 3.2
"""How much a narrow head lacks, which leaps by one neighbour where a calm front has several that help."""
_HALF_SECTOR = math.pi / 8.0


def alexandridis(wind: Tensor, gain: float, focus: float) -> Tensor:
    """Return the wind's factor, which falls off with the cosine of the angle to the wind.

        w_d = exp(c1 V) exp(c2 V (cos theta_d - 1))      (Alexandridis et al. 2008, eq. 4)

    Args:
        wind: (u, v) at the source, float32 [B, 2, h, w] [m/s]; h = w = 1 for a uniform wind.
        gain: c1 [s/m].
        focus: c2 [s/m].

    Returns:
        float32 [B, 8, h, w].
    """
    speed, along = _speed_and_part_along(wind)
    return _bounded_exp((gain - focus) * speed + focus * along)


def ellipse(wind: Tensor, head_gain: float) -> Tensor:
    """Return the wind's factor whose fires have the Canadian system's length-to-breadth ratio.

        w_d = [e^(g V) (1 - e) / (1 - e cos theta_d)]^1.67,   e = sqrt(1 - 1 / LB(V)^2)

    The speed round an ellipse from its rear focus is (1 - e) / (1 - e cos theta) of the head's; the power makes a fire
    that leaps from cell to cell by chance come out as one.

    Args:
        wind: (u, v) at the source, float32 [B, 2, h, w] [m/s].
        head_gain: g [s/m].

    Returns:
        float32 [B, 8, h, w]; exactly 1 without wind.
    """
    speed, along = _speed_and_part_along(wind)
    eccentricity = torch.sqrt(1.0 - length_to_breadth(speed).square().reciprocal())
    cosine = along / speed.clamp(min=1e-9)
    shape = torch.log1p(-eccentricity) - torch.log1p(-eccentricity * cosine)
    return _bounded_exp(1.67 * (head_gain * speed + shape))


def fbp(wind: Tensor, fuel: str, ffmc: float) -> Tensor:
    """Return the wind's factor whose heads and shapes are those of the Canadian system, at any angle to the grid.

        w_d = H(V) (1 + 3.2 x) [(1 - x) S_1(theta_d) + x S_2(theta_d)],   x = 1 - 1 / LB(V)

    S_p is the mean of the p-th power of an ellipse's speed, 1 / (1 - e cos theta), over the 45 degrees for which a
    direction stands, over that of a direction straight downwind. A mean over 45 degrees keeps the head of a wind that
    blows between two directions, which the speeds in the directions themselves lose. The power grows with x and the
    head with 3.2 x as a fire that leaps from cell to cell by chance needs it; both were measured on such fires, and
    are ours.

    Args:
        wind: (u, v) at the source, float32 [B, 2, h, w] [m/s].
        fuel: Fuel type of the Canadian system, for the head: see ``head_factor``.
        ffmc: Fine fuel moisture code.

    Returns:
        float32 [B, 8, h, w]; exactly 1 without wind.
    """
    speed = torch.sqrt(wind[:, :1].square() + wind[:, 1:].square())
    ratio = length_to_breadth(speed)
    narrow = 1.0 - ratio.reciprocal()
    eccentricity = torch.sqrt(1.0 - ratio.square().reciprocal())
    east, north = _edges(wind.device)
    u, v = (part / speed.clamp(min=1e-9) for part in (wind[:, :1], wind[:, 1:]))
    cosine = u * east[:, None, None] + v * north[:, None, None]
    sine = u * north[:, None, None] - v * east[:, None, None]
    tangent = torch.where(cosine < 0.0, (1.0 - cosine) / sine, sine / (1.0 + cosine))  # of half the angle
    left = _integrals(cosine, sine, tangent, eccentricity)
    head = _integrals(*(math.cos(_HALF_SECTOR), math.sin(_HALF_SECTOR), math.tan(_HALF_SECTOR / 2.0)), eccentricity)
    first, second = (
        _between(edge, whole) / (2.0 * half) for edge, half, whole in zip(left, head, _whole(eccentricity), strict=True)
    )
    factor = head_factor(speed, fuel, ffmc) * (1.0 + _ALONE * narrow) * torch.lerp(first, second, eccentricity.square())
    return torch.where(speed > 0.0, factor, 1.0)


def head_factor(speed: Tensor, fuel: str, ffmc: float) -> Tensor:
    """Return how much faster than in calm air a fire's head is, float32, shape of ``speed`` [m/s]; 1 without wind.

        H = [(1 - exp(-b I(V))) / (1 - exp(-b I(0)))]^c      (Canadian FBP System, Forestry Canada 1992, eq. 26)

    I is the initial spread index of the wind and of the fine fuel moisture code (eqs. 45, 46, 52, 53, 53a).

    Args:
        speed: Of the wind [m/s].
        fuel: Fuel type, a key of ``behaviour.fbp_fuels.FUEL_TYPES``.
        ffmc: Fine fuel moisture code, 0..101.
    """
    kind, fine = FUEL_TYPES[fuel], fine_fuel_effect(torch.full((), float(ffmc), device=speed.device))
    now, calm = (
        torch.log(-torch.expm1(-kind.b * spread_index(fine, _KM_PER_HOUR * each)))
        for each in (speed, torch.zeros_like(speed))
    )
    return torch.exp(kind.c * (now - calm))


def _integrals(
    cosine: Tensor | float, sine: Tensor | float, tangent: Tensor | float, eccentricity: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the integrals of 1 / (1 - e cos t) and of its square from 0 to an angle, in (-pi, pi]."""
    minor = 1.0 - eccentricity.square()
    first = 2.0 / torch.sqrt(minor) * torch.atan(torch.sqrt((1.0 + eccentricity) / (1.0 - eccentricity)) * tangent)
    return first, (eccentricity * sine / (1.0 - eccentricity * cosine) + first) / minor


def _whole(eccentricity: Tensor) -> tuple[Tensor, Tensor]:
    """Return the integrals over the whole circle."""
    minor = 1.0 - eccentricity.square()
    first = 2.0 * math.pi / torch.sqrt(minor)
    return first, first / minor


def _between(left: Tensor, whole: Tensor) -> Tensor:
    """Return the integral over each direction's sector, of those to its left edge; the angle may pass pi within it."""
    part = left - left.roll(-1, 1)  # a direction's right edge is the next one's left edge
    return torch.where(part < 0.0, part + whole, part)


def length_to_breadth(speed: Tensor) -> Tensor:
    """Return a fire's length over its breadth in a wind, float32, shape of ``speed`` [m/s]; 1 without wind.

    LB = 1 + 8.729 (1 - exp(-0.030 W))^2.155, W in km/h      (Canadian FBP System, Forestry Canada 1992, eq. 79)
    """
    part = -torch.expm1(-0.030 * _KM_PER_HOUR * speed)
    # A power as exp and log: torch's pow gives other last bits in other batches, and a world must not.
    return 1.0 + 8.729 * torch.exp(2.155 * torch.log(part))


def slope_factor(elevation: Tensor, cell_size: float, gain: float) -> Tensor:
    """Return how the ground helps a fire that travels in each direction into each cell.

        s_d = exp(a slope),  slope = arctan((z_target - z_source) / distance) in degrees

    Args:
        elevation: float32 [B, H, W] [m].
        cell_size: Side of a cell [m].
        gain: a [1/degree].

    Returns:
        float32 [B, 8, H + 2, W + 1]: the first row, the last row and the last column are margin, so that a neighbour of
        any cell lies within its world, as ``ignition_chance`` needs it.
    """
    ground = pad(elevation[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
    height, width = elevation.shape[1:]
    factors = []
    for (row, column), distance in zip(DIRECTIONS, DISTANCES, strict=True):
        source = ground[:, 1 - row : 1 - row + height, 1 - column : 1 - column + width]
        slope = torch.atan((elevation - source) / (distance * cell_size)) * (180.0 / math.pi)
        factors.append(_bounded_exp(gain * slope))
    return pad(torch.stack(factors, dim=1), (0, 1, 1, 1))


def _speed_and_part_along(wind: Tensor) -> tuple[Tensor, Tensor]:
    """Return the wind's speed [B, 1, h, w] and its part along each direction V cos theta [B, 8, h, w] [m/s]."""
    # Not torch's norm, whose last bits depend on the batch.
    speed = torch.sqrt(wind[:, :1].square() + wind[:, 1:].square())
    east, north = _directions(wind.device)
    return speed, wind[:, :1] * east[:, None, None] + wind[:, 1:] * north[:, None, None]


def _bounded_exp(exponent: Tensor) -> Tensor:
    """Return exp of it, kept so that no product of two factors leaves float32: a chance ends at 1 anyway."""
    return torch.exp(exponent.clamp(-40.0, 40.0))


@kept(8)
def _directions(device: torch.device) -> tuple[Tensor, Tensor]:
    vectors = unit_vectors(device)
    return vectors[:, 0].contiguous(), vectors[:, 1].contiguous()


@kept(8)
def _edges(device: torch.device) -> tuple[Tensor, Tensor]:
    """Return east and north of the left edge of each direction's sector, counter-clockwise of it, float32 [8]."""
    angle = [math.pi / 2.0 - direction * 2.0 * _HALF_SECTOR + _HALF_SECTOR for direction in range(8)]
    return tuple(torch.tensor([part(each) for each in angle], device=device) for part in (math.cos, math.sin))  # type: ignore[return-value]
