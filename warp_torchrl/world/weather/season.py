"""Live fuel by the season: the growing season index, and the moistures of herbs and shrubs that follow.

    GSI = iT iV iP,    iT = (T - -2 C) / 7 C,    iV = 1 - (V - 900 Pa) / 3200 Pa,    iP = (P - 10 h) / 1 h

each held in [0, 1]: T the lowest temperature of a day, V the day's mean vapour pressure deficit and P the length of the
day (Jolly, Nemani and Running 2005). Its mean over 21 days gives moistures, as in the National Fire Danger Rating
System of 2016: herbs have 30 % below an index of 0.5, and from 30 to 250 % above; shrubs 60, and 60 to 200 %.
"""

import math

import torch
from torch import Tensor

DAYS = 21
"""Days over which the index is averaged."""
GREEN = 0.5
"""Index from which leaves are out."""
SHORT_DAY = 11.0
"""Hours of a day from which its length does not hold growth back."""
_COLD, _WARM = -2.0, 5.0  # C
_MOIST, _DRY = 900.0, 4100.0  # Pa
_SHORTEST = 10.0  # hours
_HERBS, _SHRUBS = (30.0, 250.0), (60.0, 200.0)  # per cent
_TILT = -0.4092797  # declination of the sun at the winter solstice [rad]
_RADIANS_A_DAY, _SOLSTICE = 0.017214, 10.25  # days from the solstice to the new year
_CURED, _LIVING = 30.0, 120.0  # moisture at which grass is cured, and at which all of it lives [per cent]


def day_length(latitude: float, day: int) -> float:
    """Return the hours from sunrise to sunset.

    Args:
        latitude: [degrees north].
        day: Of the year, 1..366.
    """
    declination = _TILT * math.cos(_RADIANS_A_DAY * (day + _SOLSTICE - 1.0))
    half = -math.tan(math.radians(latitude)) * math.tan(declination)
    return 24.0 / math.pi * math.acos(min(1.0, max(-1.0, half)))


def saturation_pressure(temperature: Tensor) -> Tensor:
    """Return the pressure of saturated vapour over water [Pa] at a temperature [C] (Alduchov and Eskridge 1996)."""
    return 610.94 * torch.exp(17.625 * temperature / (243.04 + temperature))


def vapour_pressure_deficit(temperature: Tensor, humidity: Tensor) -> Tensor:
    """Return how much vapour the air could take up [Pa].

    Args:
        temperature: [C].
        humidity: [per cent].
    """
    return saturation_pressure(temperature) * (1.0 - humidity / 100.0)


def growing_season_index(coldest: Tensor, deficit: Tensor, length: Tensor) -> Tensor:
    """Return the index of days, in [0, 1].

    Args:
        coldest: T of each day [C].
        deficit: V [Pa].
        length: P [hours].
    """
    warm = ((coldest - _COLD) / (_WARM - _COLD)).clamp(0.0, 1.0)
    moist = (1.0 - (deficit - _MOIST) / (_DRY - _MOIST)).clamp(0.0, 1.0)
    light = ((length - _SHORTEST) / (SHORT_DAY - _SHORTEST)).clamp(0.0, 1.0)
    return warm * moist * light


def season_index(hours: Tensor, temperature: Tensor, humidity: Tensor, day: int, latitude: float) -> float | None:
    """Return the mean index of the 21 days before a fire, None where the weather begins later.

    Args:
        hours: Of rows, from the fire's start, float32 [T]; those before it are negative.
        temperature: Of the rows [C].
        humidity: Of the rows [per cent].
        day: Of the year, when the fire starts, 1..366.
        latitude: [degrees north].
    """
    back = torch.floor(-hours / 24.0 - 1e-6).long()  # 0 are the last 24 hours before the start
    deficit, found = vapour_pressure_deficit(temperature, humidity), []
    for days in range(DAYS):
        rows = (back == days) & (hours < 0.0)
        if not bool(rows.any()):
            return None
        length = torch.tensor(day_length(latitude, (day - 1 - days - 1) % 365 + 1))
        found.append(growing_season_index(temperature[rows].min(), deficit[rows].mean(), length))
    return float(torch.stack(found).mean())


def live_moistures(index: float) -> tuple[float, float]:
    """Return the moisture of herbs and of shrubs [per cent] at an index."""
    part = (index - GREEN) / (1.0 - GREEN) if index >= GREEN else 0.0
    herbs, shrubs = (low + part * (high - low) for low, high in (_HERBS, _SHRUBS))
    return herbs, shrubs


def curing_of(herbs: float) -> float:
    """Return how much of grass is cured at a moisture of herbs, both in per cent (Scott and Burgan 2005)."""
    return 100.0 * min(1.0, max(0.0, (_LIVING - herbs) / (_LIVING - _CURED)))
