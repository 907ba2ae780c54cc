"""From a table of weather to the spells that a fire meets: wind on the map's own north, moisture in the law's order."""

import torch
from torch import Tensor

from warp_torchrl.weather.table import OPEN_10M_OVER_20FT, Weather, WeatherTable
from warp_torchrl.world.alone import Spell
from warp_torchrl.world.fuel_bed import MOISTURES


def spells(table: WeatherTable, start: float, minutes: float, convergence: float = 0.0) -> list[Spell]:
    """Return the weather from a start on, a spell for each row that holds in that time.

    Args:
        table: The weather; its last row holds on, its first also before.
        start: When the fire starts, since the first row began [minutes].
        minutes: How long the fire is followed.
        convergence: Angle from true north to the map's grid north, clockwise [degrees]: bearings of the table are from
            true north, those of the map from grid north.

    Raises:
        ValueError: If the time is not over 0 minutes.
    """
    if not 0.0 < minutes < 1e7:
        raise ValueError(f"hours must be over 0 and at most 1e5, got {minutes / 60.0:g}")
    end = start + minutes
    edges = [start, *(edge for edge in (table.hours.double() * 60.0).tolist() if start < edge < end), end]
    return [
        _spell(table.at((begin + until) / 2.0), until - begin, convergence)
        for begin, until in zip(edges[:-1], edges[1:], strict=True)
    ]


def lasting(table: WeatherTable, start: float) -> float:
    """Return the minutes from a start to the end of the last row, which lasts as long as the one before; 1 hour alone.

    Raises:
        ValueError: If the start is not before that end.
    """
    hours = table.hours.double()
    last = float(hours[-1] - hours[-2]) if len(hours) > 1 else 1.0
    end = (float(hours[-1]) + last) * 60.0
    if not start < end:
        raise ValueError(f"start must be before the weather's end, {end:g} minutes after its first row, got {start:g}")
    return end - start


def _spell(weather: Weather, minutes: float, convergence: float) -> Spell:
    height = OPEN_10M_OVER_20FT if weather.wind_height == "20ft" else 1.0
    angle = torch.deg2rad(weather.wind_bearing - convergence)
    speed = weather.wind_speed * height
    return Spell(torch.stack((-speed * angle.sin(), -speed * angle.cos())), minutes, _moisture(weather))


def _moisture(weather: Weather) -> Tensor:
    """Return the moistures in the law's order, float32 [7], NaN where the table does not tell."""
    values = [getattr(weather, name) for name in MOISTURES]
    return torch.stack([torch.tensor(torch.nan) if value is None else value.to(torch.float32) for value in values])
