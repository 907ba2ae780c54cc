"""Crown fire over a surface fire: whether crowns burn, how fast their fire spreads, and how hot.

Crowns ignite where the surface fire is hot enough (Van Wagner 1977) and they cover more than ``LEAST_COVER``. Their
fire is active, a wall from the ground to the top, where it is fast enough for their density (Van Wagner 1977); else
passive, of single trees. Two rules say how fast it is:

- ``cruz``: Cruz, Alexander and Wakimoto (2005), from experimental crown fires.
- ``rothermel``: Rothermel (1991, INT-438), 3.34 times fuel model 10; a passive crown fire spreads as the surface fire.

The head of the fire is the faster of the two. The package pyretechnics is the witness in the tests: it has the rule
of Cruz, the least cover, the sum of the intensities, and the horizontal wind carried onto the slope.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.rothermel import bed_response
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.behaviour.standard_fuels import anderson_13
from warp_torchrl.world.behaviour.surface import LONGEST, flame_length, head_of_fire
from warp_torchrl.world.behaviour.wind_adjustment import TEN_METRES

CrownModel = Literal["cruz", "rothermel", "none"]
"""Rules of the rate of crown fire."""
FOLIAR_MOISTURE = 100.0
"""Water in needles where nothing is said [% of dry weight]; the default of FlamMap and BehavePlus."""
LEAST_COVER = 40.0
"""Canopy cover [%] up to which no fire runs in crowns; as in ELMFIRE and pyretechnics."""
KILOJOULES_PER_KG = 2.326
"""kJ/kg in a Btu/lb."""
_KMH = 3.6
"""Kilometres an hour in a metre a second."""
_MPH = 0.44704
"""Metres a second in a mile an hour."""
_CALM = 1e-6
"""A wind [km/h] too weak to matter, at which its power still has a gradient."""
_SHELTERED = 0.4
"""Midflame wind of fuel model 10 over the wind at 20 ft (Rothermel 1991)."""
_LEAST = 1e-9


@dataclass(frozen=True)
class Canopy:
    """The crowns over some cells; all fields broadcast with them."""

    cover: Tensor  # ground under crowns seen from above [%]
    height: Tensor  # of the crowns' top [m]
    base_height: Tensor  # of their lower side [m]
    bulk_density: Tensor  # of what burns in them [kg/m3]


@dataclass(frozen=True)
class Surroundings:
    """Wind, slope and moisture about some cells; all fields broadcast with them."""

    wind_speed: Tensor  # at 10 m in the open [m/s]
    wind_bearing: Tensor  # where it comes from [degrees clockwise from grid north]
    slope: Tensor  # [degrees]
    aspect: Tensor  # where downhill is [degrees clockwise from grid north]
    moisture: Tensor  # [..., 5], dead fuel of 1, 10 and 100 hours, live herbaceous and woody [% of dry weight]


def with_crowns(
    surface: Spread,
    canopy: Canopy,
    air: Surroundings,
    *,
    heat: Tensor,
    foliar_moisture: Tensor | float = FOLIAR_MOISTURE,
    model: Literal["cruz", "rothermel"] = "cruz",
    gain: Tensor | float = 1.0,
) -> Spread:
    """Return the behaviour of the head of a surface fire where crowns may burn; without any it is the same to the bit.

    Where crowns burn, the head and its ellipse are those of the faster fire, and both release their heat:

        R = max(R_s, R_c),    I = (H_s + c (z - b) h) R / 60

    H_s is the heat of the surface fire [kJ/m2], c the bulk density, z and b the height of the crowns' top and base, and
    h their heat content. Flames are those of Byram (1959).

    Args:
        surface: The surface fire.
        canopy: The crowns.
        air: The surroundings.
        heat: Heat content of the crowns, as that of the fuel below [kJ/kg].
        foliar_moisture: Water in needles [% of dry weight].
        model: Rule of the rate.
        gain: Factor on the intensity of the surface fire when crowns are to ignite.
    """
    crown, is_active = _RULES[model](canopy, air)
    least = critical_intensity(canopy.base_height, torch.as_tensor(foliar_moisture))
    crowns = (surface.intensity > 0.0) & (surface.intensity * gain >= least)
    crowns = crowns & (canopy.cover > LEAST_COVER) & (canopy.bulk_density > 0.0)
    faster = crowns & (crown.head > surface.head)
    head = torch.where(faster, crown.head, surface.head)
    load = canopy.bulk_density * (canopy.height - canopy.base_height).clamp(min=0.0)
    both = surface.intensity * (head / surface.head.clamp(min=_LEAST)) + load * heat * head / 60.0
    return Spread(
        head=head,
        direction=torch.where(faster, crown.direction, surface.direction),
        length_to_breadth=torch.where(faster, crown.length_to_breadth, surface.length_to_breadth),
        intensity=torch.where(crowns, both, surface.intensity),
        flame_length=torch.where(crowns, flame_length(both), surface.flame_length),
        kind=crowns.to(head.dtype) * (1.0 + is_active),
    )


def critical_intensity(base_height: Tensor, foliar_moisture: Tensor) -> Tensor:
    """Return the intensity of the surface fire at which crowns ignite, (0.01 b (460 + 26 m))^1.5 [kW/m].

    Van Wagner 1977, eq. 4.

    Args:
        base_height: b, of the crowns' lower side [m].
        foliar_moisture: m, water in needles [% of dry weight].
    """
    heat = 0.01 * base_height * (460.0 + 26.0 * foliar_moisture)
    return heat * heat.sqrt()


def critical_rate(bulk_density: Tensor) -> Tensor:
    """Return the rate at which crown fire is active, 3 / c [m/min] (Van Wagner 1977, 0.05 kg/m2/s)."""
    return 3.0 / bulk_density.clamp(min=_LEAST)


def cruz_active_rate(wind_speed: Tensor, bulk_density: Tensor, dead_moisture: Tensor) -> Tensor:
    """Return the rate of active crown fire, 11.02 U^0.90 c^0.19 exp(-0.17 M) [m/min] (Cruz et al. 2005).

    Args:
        wind_speed: U, at 10 m in the open [km/h].
        bulk_density: c [kg/m3].
        dead_moisture: M, of fine dead fuel [% of dry weight].
    """
    blown = torch.where(wind_speed > _CALM, wind_speed.clamp(min=_CALM) ** 0.90, 0.0)
    return 11.02 * blown * bulk_density.clamp(min=_LEAST) ** 0.19 * torch.exp(-0.17 * dead_moisture)


def cruz_rate(wind_speed: Tensor, bulk_density: Tensor, dead_moisture: Tensor) -> tuple[Tensor, Tensor]:
    """Return the rate of crown fire [m/min] (Cruz et al. 2005), and whether it is active.

    A passive one spreads at R exp(-R c / 3) of the active rate R. The arguments are those of ``cruz_active_rate``.
    """
    active, least = cruz_active_rate(wind_speed, bulk_density, dead_moisture), critical_rate(bulk_density)
    is_active = active > least
    return torch.where(is_active, active, active * torch.exp(-active / least)), is_active


def crown_length_to_breadth(wind_speed: Tensor) -> Tensor:
    """Return length to breadth of a crown fire, 1 + 0.125 U in miles an hour at 20 ft (Rothermel 1991, eq. 9), up to 8.

    Args:
        wind_speed: At 10 m in the open [m/s].
    """
    return (1.0 + 0.125 * wind_speed / TEN_METRES / _MPH).clamp(max=LONGEST)


def _cruz(canopy: Canopy, air: Surroundings) -> tuple[Spread, Tensor]:
    """Return the crown fire of Cruz et al., whose head goes with the wind, and whether it is active."""
    wind = _along_slope(air)
    rate, is_active = cruz_rate(wind * _KMH, canopy.bulk_density, air.moisture[..., 0])
    return _crown_spread(rate, (air.wind_bearing + 180.0) % 360.0, wind), is_active


def _rothermel(canopy: Canopy, air: Surroundings) -> tuple[Spread, Tensor]:
    """Return the crown fire of Rothermel, whose head goes with wind and slope, and whether it is active."""
    table = anderson_13().to(device=air.wind_speed.device, dtype=air.wind_speed.dtype)
    bed = bed_response(table.fuels.at(table.index(torch.tensor(10, device=air.wind_speed.device))), air.moisture)
    midflame = air.wind_speed * (60.0 * _SHELTERED / TEN_METRES)
    below = head_of_fire(bed, midflame, air.wind_bearing, air.slope, air.aspect)
    rate = 3.34 * below.head
    is_active = rate > critical_rate(canopy.bulk_density)
    return _crown_spread(torch.where(is_active, rate, 0.0), below.direction, _along_slope(air)), is_active


_RULES: Mapping[str, Callable[[Canopy, Surroundings], tuple[Spread, Tensor]]] = {
    "cruz": _cruz,
    "rothermel": _rothermel,
}


def _crown_spread(rate: Tensor, direction: Tensor, wind: Tensor) -> Spread:
    """Return a crown fire alone; its heat is added where it joins the surface fire."""
    none = torch.zeros_like(rate)
    return Spread(rate, direction, crown_length_to_breadth(wind), none, none, none)


def _along_slope(air: Surroundings) -> Tensor:
    """Return the wind along the slope [m/s]: the horizontal wind over the cosine of the slope in its direction."""
    away = torch.deg2rad(air.wind_bearing - air.aspect)
    rise = torch.tan(torch.deg2rad(air.slope)) * torch.cos(away)
    return air.wind_speed * torch.sqrt(1.0 + rise**2)
