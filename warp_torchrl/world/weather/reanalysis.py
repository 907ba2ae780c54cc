"""Conversion of reanalysis weather: wind from its components, humidity from the dew point."""

import math
from collections.abc import Sequence

_ROUNDED = 2.0  # degrees by which stations' dew points exceed temperatures: two whole degrees of Fahrenheit at most


def wind_of(east: Sequence[float], north: Sequence[float]) -> dict[str, list[float]]:
    """Return speed [m/s] and where the wind comes from [degrees] of its components to the east and north [m/s]."""
    both = list(zip(east, north, strict=True))
    return {
        "wind_speed": [math.hypot(u, v) for u, v in both],
        "wind_bearing": [math.degrees(math.atan2(-u, -v)) % 360.0 if u or v else 0.0 for u, v in both],
    }


def humidity_of(temperature: Sequence[float], dew_point: Sequence[float]) -> list[float]:
    """Return relative humidity [per cent] of temperature and dew point [C] (Magnus; Alduchov and Eskridge 1996).

    Raises:
        ValueError: If a dew point is more than 2 degrees above its temperature: columns or units are exchanged.
    """
    both = list(zip(temperature, dew_point, strict=True))
    for row, (air, dew) in enumerate(both, 1):
        if dew > air + _ROUNDED:
            raise ValueError(f"dew_point must be at most the temperature, got {dew:.4g} and {air:.4g} C in row {row}")
    return [min(100.0, 100.0 * _pressure(dew) / _pressure(air)) for air, dew in both]


def _pressure(temperature: float) -> float:
    """Return the pressure of saturated vapour over water [hPa]."""
    return 6.1094 * math.exp(17.625 * temperature / (243.04 + temperature))
