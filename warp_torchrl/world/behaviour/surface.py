"""Head of a surface fire in wind and on slopes, from its fuel bed's response without them.

Wind and slope factors are added as vectors on the slope (Rothermel 1983; Finney 1998, RMRS-RP-4). Three choices follow
the package pyretechnics, which is the witness in the tests:

- The horizontal wind is carried onto the slope: a wind straight up or down a slope of angle s counts 1 / cos(s) times.
- The effective wind is limited to 0.9 ft/min per Btu/ft2/min of reaction intensity (Rothermel 1972 eqs. 86 and 87).
- Length to breadth is that of Anderson (1983) in the form of FARSITE, and 8 at most.

Rates are along the ground: on a map, a head straight up a slope of angle s goes cos(s) times as far.
"""

import math

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.fuel_models import FuelTable
from warp_torchrl.world.behaviour.rothermel import BedResponse, bed_response
from warp_torchrl.world.behaviour.spread import Spread

LONGEST = 8.0
"""The largest length to breadth."""
_MPH = 60.0 * 0.44704
"""Metres a minute in a mile an hour."""
_CALM = 1e-6
"""A wind [m/min] and a factor too small to matter, at which powers below 1 still have a gradient."""


def surface_spread(
    table: FuelTable,
    row: Tensor,
    *,
    wind_speed: Tensor,
    wind_bearing: Tensor,
    slope: Tensor,
    aspect: Tensor,
    moisture: Tensor,
) -> Spread:
    """Return the behaviour of the head of a surface fire in each cell; arguments are not checked.

    Terms without wind and slope are computed once for each fuel model and world, and looked up in each cell, unless
    moisture is given per cell.

    Args:
        table: Fuel models.
        row: Row of each cell's model in the table, int64 [H, W] or [B, H, W]; ``table.index(codes)``.
        wind_speed: Wind at midflame height, broadcast with the cells [m/s].
        wind_bearing: Direction from which it blows, the same [degrees clockwise from grid north].
        slope: Steepness, the same [degrees].
        aspect: Downhill direction, the same [degrees clockwise from grid north].
        moisture: Of dead fuel of 1, 10 and 100 hours, live herbaceous and live woody fuel: [5], [B, 5] by world, or
            [..., H, W, 5] by cell [%].
    """
    if moisture.dim() > 2:
        beds = bed_response(table.fuels.at(row), moisture)
    elif moisture.dim() == 2:
        models = len(table.fuels.depth)
        first = torch.arange(0, len(moisture) * models, models, device=row.device)
        beds = bed_response(table.fuels, moisture[:, None, :]).at(row + first[:, None, None])
    else:
        beds = bed_response(table.fuels, moisture).at(row)
    return head_of_fire(beds, wind_speed * 60.0, wind_bearing, slope, aspect)


def head_of_fire(beds: BedResponse, wind: Tensor, wind_bearing: Tensor, slope: Tensor, aspect: Tensor) -> Spread:
    """Return the behaviour of the head on fuel beds, in tensors of the shape to which all arguments broadcast.

    Without wind and slope the direction is 0.

    Args:
        beds: What the fuel beds do.
        wind: At midflame height [m/min].
        wind_bearing: Where it comes from [degrees clockwise from grid north].
        slope: Steepness [degrees].
        aspect: Where downhill is [degrees clockwise from grid north].
    """
    factor, direction = _wind_and_slope(beds, wind, wind_bearing, slope, aspect)
    effective = (factor.clamp(min=_CALM**2) / beds.wind_scale) ** (1.0 / beds.wind_power)
    limited = effective > beds.top_wind
    most = beds.wind_scale * beds.top_wind.clamp(min=_CALM) ** beds.wind_power
    factor = torch.where(limited, torch.minimum(factor, most), factor)
    effective = torch.where(limited, beds.top_wind, effective)
    head = beds.rate * (1.0 + factor)
    intensity = beds.heat * head / 60.0
    return Spread(
        head=head,
        direction=direction.expand(head.shape),
        length_to_breadth=length_to_breadth(effective),
        intensity=intensity,
        flame_length=flame_length(intensity),
        kind=torch.zeros((), device=head.device).expand(head.shape),
    )


def _wind_and_slope(
    beds: BedResponse, wind: Tensor, wind_bearing: Tensor, slope: Tensor, aspect: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the factor of wind and slope together, and its direction [degrees]."""
    steep = torch.tan(torch.deg2rad(slope))
    from_wind, from_slope = torch.deg2rad(wind_bearing), torch.deg2rad(aspect)
    rise = steep * torch.cos(from_wind - from_slope)  # of the wind, per unit of map
    stretch, slant = torch.sqrt(1.0 + rise**2), torch.sqrt(1.0 + steep**2)
    blown = wind * stretch
    push = torch.where(blown > _CALM, beds.wind_scale * blown.clamp(min=_CALM) ** beds.wind_power, 0.0)
    pull = beds.slope_scale * steep**2
    push, pull = push / stretch, pull / slant
    east = -(push * torch.sin(from_wind) + pull * torch.sin(from_slope))
    north = -(push * torch.cos(from_wind) + pull * torch.cos(from_slope))
    up = push * rise + pull * steep
    squares = east**2 + north**2 + up**2
    moved = squares > 0.0
    factor = torch.where(moved, torch.where(moved, squares, 1.0).sqrt(), 0.0)
    turn = torch.atan2(torch.where(moved, east, 0.0), torch.where(moved, north, 1.0)) * (180.0 / math.pi) % 360.0
    return factor, torch.where(turn < 360.0, turn, 0.0)  # what is just below 0 becomes 360 by rounding


def length_to_breadth(effective_wind: Tensor) -> Tensor:
    """Return the ratio of length to breadth of a fire's ellipse, in [1, 8] (Anderson 1983; Finney 1998).

    Finney's form is 1 without wind, which Anderson's is not.

    Args:
        effective_wind: The midflame wind that does what wind and slope do together [m/min].
    """
    miles = effective_wind / _MPH
    ratio = 0.936 * torch.exp(0.1147 * miles.clamp(max=40.0)) + 0.461 * torch.exp(-0.0692 * miles) - 0.397
    return ratio.clamp(1.0, LONGEST)


def flame_length(intensity: Tensor) -> Tensor:
    """Return the length of flames [m] of a fireline intensity [kW/m] (Byram 1959)."""
    burns = intensity > 0.0
    return torch.where(burns, 0.0775 * torch.where(burns, intensity, 1.0) ** 0.46, 0.0)
