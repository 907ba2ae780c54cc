"""The Canadian Forest Fire Behavior Prediction (FBP) System: behaviour of a fire's head in each fuel type.

Equations: Forestry Canada Fire Danger Group 1992, "Development and structure of the Canadian Forest Fire Behavior
Prediction System", ST-X-3; with the corrections of Wotton, Alexander and Taylor 2009, GLC-X-10. Numbers of equations
are those of ST-X-3 unless GLC-X-10 is named. Results are for the steady state, unless a fire's first minutes are asked
for: see ``behaviour.acceleration``.
Crowning is included: where the head is fast enough, crowns burn, and C-6 then spreads faster.
"""

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.acceleration import OPEN, mean_share, slowed, under_canopy
from warp_torchrl.world.behaviour.fbp_fuels import FUEL_TYPES, FbpFuels, Number, fbp_fuels
from warp_torchrl.world.behaviour.spread import Spread

KMH = 3.6
"""Kilometres an hour in a metre a second."""
_CALM = 1e-6
"""A wind [km/h] too weak to matter, that gives a fire without wind and slope a direction, and a gradient."""
FOLIAR_MOISTURE = 97.0
"""Water in needles that eq. 61 divides by [per cent]."""
_ASPEN = FUEL_TYPES["D-1"]


def fbp_spread(
    fuel: Tensor | FbpFuels,
    *,
    wind_speed: Number,
    wind_bearing: Number,
    slope: Number,
    aspect: Number,
    ffmc: Number,
    bui: Number,
    curing: Number = 80.0,
    percent_conifer: Number = 50.0,
    percent_dead_fir: Number = 35.0,
    grass_load: Number = 0.35,
    green: bool = False,
    foliar_moisture: Number = FOLIAR_MOISTURE,
    young: tuple[float, float] | None = None,
) -> Spread:
    """Return the behaviour of a fire's head, in tensors of the shape to which all arguments broadcast.

    Everything can be differentiated by weather and moisture; at thresholds of the system the derivative is one-sided.
    Without wind and slope the head goes where the wind of zero speed would blow to. At a buildup index of 0
    nothing but grass spreads: that is the limit of eq. 54 (the package cffdrs takes 0 for "without effect").

    Args:
        fuel: Codes of fuel types (see `fbp_fuels`), or what `fbp_fuels` made of them; then the five arguments from
            `curing` on are those given there.
        wind_speed: Wind at 10 m in the open [m/s].
        wind_bearing: Where the wind comes from [degrees clockwise from grid north].
        slope: Steepness [degrees]; past 35 degrees (70 per cent) it counts as that.
        aspect: Where downhill is [degrees clockwise from grid north].
        ffmc: Fine fuel moisture code, 0..101.
        bui: Buildup index, 0 or more.
        curing: Cured grass in O-1 [per cent].
        percent_conifer: Conifers in M-1 and M-2 whose code does not say it [per cent].
        percent_dead_fir: Dead balsam fir in M-3 and M-4 whose code does not say it [per cent].
        grass_load: Fuel in grass [kg/m2].
        green: Whether leaves are out: whether 13 is D-2 (not D-1), 60 M-2 (not M-1) and 90 M-4 (not M-3).
        foliar_moisture: Water in needles [per cent of dry weight]; 97 is the average that eq. 61 divides by.
        young: Minutes since ignition, first and last, over which the spread is the mean of a fire that accelerates.

    Raises:
        ValueError: If the codes are not whole numbers, or a per cent or load lies out of its range.
    """
    if isinstance(fuel, Tensor):
        fuel = fbp_fuels(
            fuel,
            curing=curing,
            percent_conifer=percent_conifer,
            percent_dead_fir=percent_dead_fir,
            grass_load=grass_load,
            green=green,
        )
    device = fuel.a.device
    values = (wind_speed, wind_bearing, slope, aspect, ffmc, bui, foliar_moisture)
    speed, bearing, slope, aspect, ffmc, bui, foliar = (
        torch.as_tensor(value, dtype=torch.float32, device=device) for value in values
    )
    fine = fine_fuel_effect(ffmc)
    net_speed, direction = _net_wind(fuel, fine, speed, bearing, slope, aspect)
    index = spread_index(fine, net_speed)
    surface = buildup_effect(fuel, bui) * initial_rate(fuel, index)
    consumed = surface_consumption(fuel, ffmc, bui)
    head, crowns = _crown(fuel, index, surface, consumed, foliar)
    intensity = 300 * (consumed + fuel.crown_load * crowns) * head  # eq. 69
    shape = torch.broadcast_shapes(intensity.shape, direction.shape)
    burns = fuel.a > 0
    steady = Spread(
        head=torch.where(burns, head, 0.0).expand(shape),
        direction=direction.expand(shape),
        length_to_breadth=torch.where(burns, length_to_breadth(fuel, net_speed), 1.0).expand(shape),
        intensity=torch.where(burns, intensity, 0.0).expand(shape),
        flame_length=torch.where(burns, byram_flame_length(intensity), 0.0).expand(shape),
        kind=torch.where(burns, kind_of_fire(crowns), 0.0).expand(shape),
    )
    if young is None:
        return steady
    return slowed(steady, mean_share(torch.where(fuel.is_c1, OPEN, under_canopy(crowns)), *young))


def fine_fuel_effect(ffmc: Tensor) -> Tensor:
    """Return f(F), the effect of the fine fuel moisture code on spread (eqs. 45 and 46)."""
    moisture = 147.2 * (101 - ffmc) / (59.5 + ffmc)
    return 91.9 * torch.exp(-0.1386 * moisture) * (1 + moisture**5.31 / 4.93e7)


def spread_index(fine: Tensor, wind: Tensor) -> Tensor:
    """Return the initial spread index of f(F) and a wind [km/h]; past 40 km/h it levels off (eqs. 52, 53, 53a)."""
    strong = 12 * -torch.expm1(-0.0818 * (wind.clamp(min=40) - 28))
    return 0.208 * fine * torch.where(wind > 40, strong, torch.exp(0.05039 * wind.clamp(max=40)))


def initial_rate(fuel: FbpFuels, index: Tensor) -> Tensor:
    """Return the rate of spread at an initial spread index, without the buildup effect [m/min].

    Eqs. 26 to 28 and 36; GLC-X-10 eqs. 29 to 33 for M-3 and M-4.
    """
    first = fuel.a * (-torch.expm1(-fuel.b * index)) ** fuel.c
    second = _ASPEN.a * (-torch.expm1(-_ASPEN.b * index)) ** _ASPEN.c
    return fuel.share * first + (1 - fuel.share) * fuel.aspen * second


def buildup_effect(fuel: FbpFuels, bui: Tensor) -> Tensor:
    """Return the factor of a buildup index on the rate of spread (eq. 54; GLC-X-10 for D-2: 0 below 80)."""
    bui = bui.clamp(min=1)  # exp(50 ln 0.9 / 1) is 0.005, and less in all other fuels
    effect = torch.exp(50 * torch.log(fuel.q) * (1 / bui - 1 / fuel.bui0))
    return torch.where(fuel.is_d2 & (bui < 80), 0.0, effect)


def _net_wind(
    fuel: FbpFuels, fine: Tensor, speed: Tensor, bearing: Tensor, slope: Tensor, aspect: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the speed [km/h] of wind and slope together, and its direction [degrees] (eqs. 47 to 51)."""
    wind, uphill = KMH * speed + _CALM, slope_wind(fuel, fine, slope)
    blows, climbs = torch.deg2rad(bearing + 180), torch.deg2rad(aspect + 180)
    east = wind * torch.sin(blows) + uphill * torch.sin(climbs)
    north = wind * torch.cos(blows) + uphill * torch.cos(climbs)
    return torch.sqrt(east**2 + north**2), torch.rad2deg(torch.atan2(east, north)) % 360


def slope_wind(fuel: FbpFuels, fine: Tensor, slope: Tensor) -> Tensor:
    """Return the wind [km/h] with the same effect on the rate as a slope [degrees].

    Eqs. 39 and 40; GLC-X-10 eqs. 41 to 44. The index at which level ground spreads as fast as the slope in calm is eq.
    41a, -ln(1 - (SF RSZ / a)^(1/c)) / b. As RSZ = a (1 - exp(-b ISZ))^c, the rate a drops out.
    """
    grade = torch.tan(torch.deg2rad(slope)).clamp(min=0, max=0.7)
    factor = 3.533 * grade**1.2  # ln SF; SF is 10 at a grade of 0.7
    factor = torch.where(grade < 0.7, factor, 2.302585)
    calm = 0.208 * fine
    first = _slope_index(factor, calm, fuel.b, fuel.c)
    second = _slope_index(factor, calm, torch.full_like(fuel.b, _ASPEN.b), torch.full_like(fuel.c, _ASPEN.c))
    ratio = (fuel.share * first + (1 - fuel.share) * second) / calm
    gentle = torch.log(ratio) / 0.05039
    steep = 28 - torch.log((1 - ratio / 12).clamp(min=0.001)) / 0.0818  # 112.45 km/h at most, eq. 44c
    return torch.where(grade > 0, torch.where(gentle > 40, steep, gentle), 0.0)


def _slope_index(factor: Tensor, calm: Tensor, b: Tensor, c: Tensor) -> Tensor:
    grown = torch.exp(factor / c) * -torch.expm1(-b * calm)
    return -torch.log1p(-grown.clamp(max=0.99)) / b


def surface_consumption(fuel: FbpFuels, ffmc: Tensor, bui: Tensor) -> Tensor:
    """Return the surface fuel consumption [kg/m2] (eqs. 9 to 25; GLC-X-10 eqs. 9a and 9b)."""
    first = fuel.load * (-torch.expm1(-fuel.load_rate * bui)) ** fuel.load_power
    second = fuel.second_load * -torch.expm1(-fuel.second_load_rate * bui)
    drier = ffmc - 84
    lichen = 0.75 + 0.75 * torch.sign(drier) * torch.sqrt(1e-12 - torch.expm1(-0.23 * drier.abs()))
    litter = 2 * -torch.expm1(-0.104 * (ffmc - 70).clamp(min=0))
    by_fine_fuel = torch.where(fuel.is_c1, lichen, torch.where(fuel.is_c7, litter, 0.0))
    return first + second + by_fine_fuel + fuel.constant_load


def _crown(fuel: FbpFuels, index: Tensor, surface: Tensor, consumed: Tensor, foliar: Tensor) -> tuple[Tensor, Tensor]:
    """Return the rate of the head [m/min] and the share of crowns that burn (eqs. 56 to 65).

    In C-6 the rate rises from that of the surface towards that of the crowns with the share that burns; in the others
    the surface's rate was measured with crowns burning in it.
    """
    critical = 0.001 * (fuel.crown_base * (460 + 25.9 * foliar)) ** 1.5 / (300 * consumed.clamp(min=1e-6))
    excess = torch.where(fuel.crown_load > 0, surface - critical, 0.0).clamp(min=0)
    crowns = -torch.expm1(-0.23 * excess)
    foliage = 1000 * (1.5 - 0.00275 * foliar) ** 4 / (460 + 25.9 * foliar) / 0.778
    crown_rate = 60 * -torch.expm1(-0.0497 * index) * foliage
    gain = torch.where(fuel.is_c6, (crown_rate - surface).clamp(min=0), 0.0)
    crowns = torch.where(fuel.is_c6 & (gain == 0), 0.0, crowns)
    return surface + crowns * gain, crowns


def kind_of_fire(crowns: Tensor) -> Tensor:
    """Return the kind of fire by the share of crowns that burn: crown fire from 0.1, active from 0.9 (ST-X-3)."""
    return (crowns >= 0.1).to(crowns.dtype) + (crowns >= 0.9)


def length_to_breadth(fuel: FbpFuels, wind: Tensor) -> Tensor:
    """Return the length to breadth of the fire in a net wind [km/h] (eqs. 79 and 80; GLC-X-10 eqs. 80a and 80b)."""
    forest = 1 + 8.729 * (-torch.expm1(-0.030 * wind)) ** 2.155
    grass = torch.where(wind < 1, 1.0, 1.1 * wind.clamp(min=1) ** 0.464)
    return torch.where(fuel.is_grass, grass, forest)


def byram_flame_length(intensity: Tensor) -> Tensor:
    """Return the length of the flames [m] of a fireline intensity [kW/m] (Byram 1959: 0.0775 I^0.46)."""
    return 0.0775 * intensity.clamp(min=1e-6) ** 0.46


def foliar_moisture(latitude: Number, longitude: Number, day: Number, elevation: Number | None = None) -> Tensor:
    """Return the water in conifers' needles in Canada [per cent of dry weight], 85 to 120 (eqs. 5 to 8).

    Args:
        latitude: [degrees north].
        longitude: [degrees east; Canada's are negative].
        day: Day of the year, 1..366.
        elevation: Above the sea [m]; None where it is not known.
    """
    away = days_from_lowest(latitude, longitude, day, elevation).abs()
    spring = 85 + 0.0189 * away**2
    summer = 32.9 + 3.17 * away - 0.0288 * away**2
    return torch.where(away < 30, spring, torch.where(away < 50, summer, 120.0))


def days_from_lowest(latitude: Number, longitude: Number, day: Number, elevation: Number | None = None) -> Tensor:
    """Return the days since the water in needles was lowest, negative before (eqs. 1 to 4).

    The arguments are those of ``foliar_moisture``.
    """
    latitude, longitude, day = (torch.as_tensor(value, dtype=torch.float32) for value in (latitude, longitude, day))
    if elevation is None:
        normal = 46 + 23.4 * torch.exp(-0.0360 * (150 + longitude))
        lowest = 151 * latitude / normal
    else:
        normal = 43 + 33.7 * torch.exp(-0.0351 * (150 + longitude))
        lowest = 142.1 * latitude / normal + 0.0172 * elevation
    return day - torch.round(lowest)
