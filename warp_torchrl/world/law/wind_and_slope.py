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

_KM_PER_HOUR = 3.6  # of one m/s; the Canadian system's winds are in km/h


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
