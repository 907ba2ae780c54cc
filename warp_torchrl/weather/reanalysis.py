"""Weather as reanalyses tell it: wind by its components, moisture of air by its dew point."""

import math
from collections.abc import Sequence


def wind_of(east: Sequence[float], north: Sequence[float]) -> dict[str, list[float]]:
    """Return speed [m/s] and where the wind comes from [degrees] of its components to the east and north [m/s]."""
    both = list(zip(east, north, strict=True))
    return {
        "wind_speed": [math.hypot(u, v) for u, v in both],
        "wind_bearing": [math.degrees(math.atan2(-u, -v)) % 360.0 if u or v else 0.0 for u, v in both],
    }


def humidity_of(temperature: Sequence[float], dew_point: Sequence[float]) -> list[float]:
    """Return relative humidity [per cent] of temperature and dew point [C] (Magnus; Alduchov and Eskridge 1996)."""
    both = zip(temperature, dew_point, strict=True)
    return [min(100.0, 100.0 * _pressure(dew) / _pressure(air)) for air, dew in both]


def _pressure(temperature: float) -> float:
    """Return the pressure of saturated vapour over water [hPa]."""
    return 6.1094 * math.exp(17.625 * temperature / (243.04 + temperature))
