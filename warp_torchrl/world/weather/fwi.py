"""Codes of the Canadian Forest Fire Weather Index (FWI) System, by the day and by the hour.

Equations: Van Wagner 1987, "Development and structure of the Canadian Forest Fire Weather Index System", Forestry
Technical Report 35 (as programmed by Van Wagner and Pickett 1985, Report 33); by the hour: Van Wagner 1977, PS-X-69.
Wind is at 10 m in the open. Every function takes tensors that broadcast, float32; loops go over time alone.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

Number = float | Tensor
"""A number, or a tensor of them that broadcasts with the others."""
KMH = 3.6
"""Kilometres an hour in a metre a second."""
DAILY_SCALE = 147.2
"""Of moisture against the fine fuel moisture code, as the report prints it (eqs. 1 and 10)."""
HOURLY_SCALE = 250 * 59.5 / 101
"""The same without rounding, which steps by the hour need: 0 per cent of moisture is a code of 101."""

# Length of the day by month, January first, south of 30 S, to 10 S, to 10 N, to 30 N, and north of that: for the duff
# moisture code (Van Wagner 1987 for 46 N; Lawson and Armitage 2008, NOR-X-418, for the others)
_DUFF_DAYS = torch.tensor(
    [
        [11.5, 10.5, 9.2, 7.9, 6.8, 6.2, 6.5, 7.4, 8.7, 10.0, 11.2, 11.8],
        [10.1, 9.6, 9.1, 8.5, 8.1, 7.8, 7.9, 8.3, 8.9, 9.4, 9.9, 10.2],
        [9.0] * 12,
        [7.9, 8.4, 8.9, 9.5, 9.9, 10.2, 10.1, 9.7, 9.1, 8.6, 8.1, 7.8],
        [6.5, 7.5, 9.0, 12.8, 13.9, 13.9, 12.4, 10.9, 9.4, 8.0, 7.0, 6.0],
    ]
)
_DUFF_LATITUDES = torch.tensor([-30.0, -10.0, 10.0, 30.0])
# The same for the drought code, south of 20 S, between, and north of 20 N
_DROUGHT_DAYS = torch.tensor(
    [
        [6.4, 5.0, 2.4, 0.4, -1.6, -1.6, -1.6, -1.6, -1.6, 0.9, 3.8, 5.8],
        [1.4] * 12,
        [-1.6, -1.6, -1.6, 0.9, 3.8, 5.8, 6.4, 5.0, 2.4, 0.4, -1.6, -1.6],
    ]
)
_DROUGHT_LATITUDES = torch.tensor([-20.0, 20.0])


@dataclass(frozen=True)
class FireWeather:
    """The six codes of the system, day by day; all fields float32 [T, ...]."""

    ffmc: Tensor  # fine fuel moisture code, 0..101
    dmc: Tensor  # duff moisture code, 0 or more
    dc: Tensor  # drought code, 0 or more
    isi: Tensor  # initial spread index
    bui: Tensor  # buildup index
    fwi: Tensor  # fire weather index


def fire_weather(
    temperature: Tensor,
    humidity: Tensor,
    wind_speed: Tensor,
    rain: Tensor,
    *,
    month: Tensor,
    latitude: Number = 46.0,
    ffmc: Number = 85.0,
    dmc: Number = 6.0,
    dc: Number = 15.0,
) -> FireWeather:
    """Return the codes of each day of a series, for one place or many at once.

    Args:
        temperature: At noon, standard time [T, ...] [C].
        humidity: At noon [T, ...] [per cent].
        wind_speed: At noon, at 10 m in the open [T, ...] [m/s].
        rain: Of the 24 hours before noon [T, ...] [mm].
        month: 1..12, whole numbers [T] or [T, ...].
        latitude: Of the places [...] [degrees north]; it decides how long a day dries.
        ffmc: Fine fuel moisture code of the day before the first; 85 is the system's start after snow.
        dmc: Duff moisture code of that day.
        dc: Drought code of that day.
    """
    codes = []
    ffmc, dmc, dc, latitude = (torch.as_tensor(value, dtype=torch.float32) for value in (ffmc, dmc, dc, latitude))
    for noon, damp, wind, wet, of_year in zip(temperature, humidity, wind_speed, rain, month, strict=True):
        ffmc = daily_ffmc(ffmc, noon, damp, wind, wet)
        dmc = daily_dmc(dmc, noon, damp, wet, of_year, latitude)
        dc = daily_dc(dc, noon, wet, of_year, latitude)
        codes.append(torch.stack(torch.broadcast_tensors(ffmc, dmc, dc)))
    ffmc, dmc, dc = torch.stack(codes).unbind(1)
    isi, bui = initial_spread_index(ffmc, wind_speed), buildup_index(dmc, dc)
    return FireWeather(ffmc, dmc, dc, isi, bui, fire_weather_index(isi, bui))


def daily_ffmc(ffmc: Tensor, temperature: Tensor, humidity: Tensor, wind_speed: Tensor, rain: Tensor) -> Tensor:
    """Return the fine fuel moisture code a day later (eqs. 1 to 10; the canopy keeps the first 0.5 mm of rain)."""
    moisture = _wetted(_moisture(ffmc, DAILY_SCALE), (rain - 0.5).clamp(min=0))
    return _code(_dried(moisture, temperature, humidity, wind_speed, 0.581), DAILY_SCALE)


def hourly_ffmc(
    ffmc: Tensor, temperature: Tensor, humidity: Tensor, wind_speed: Tensor, rain: Tensor, hours: Number = 1.0
) -> Tensor:
    """Return the fine fuel moisture code some hours later, in constant weather (Van Wagner 1977).

    Args:
        ffmc: The code before.
        temperature: [C].
        humidity: [per cent].
        wind_speed: At 10 m in the open [m/s].
        rain: That falls in these hours [mm].
        hours: How long; steps of much more than an hour are not what the equations were made for.
    """
    moisture = _wetted(_moisture(ffmc, HOURLY_SCALE), rain)
    return _code(_dried(moisture, temperature, humidity, wind_speed, 0.0579 * hours), HOURLY_SCALE)


def _moisture(ffmc: Tensor, scale: float) -> Tensor:
    return scale * (101 - ffmc) / (59.5 + ffmc)


def _code(moisture: Tensor, scale: float) -> Tensor:
    return (59.5 * (250 - moisture) / (scale + moisture)).clamp(0, 101)


def _wetted(moisture: Tensor, rain: Tensor) -> Tensor:
    """Return the moisture [per cent] after rain that reaches the litter [mm] (eqs. 3a and 3b)."""
    some = rain.clamp(min=1e-6)  # no rain adds nothing: 42.5e-6 per cent
    gain = 42.5 * some * torch.exp(-100 / (251 - moisture)) * -torch.expm1(-6.93 / some)
    soaked = 0.0015 * (moisture - 150).clamp(min=0) ** 2 * torch.sqrt(some)
    return torch.where(rain > 0, (moisture + gain + soaked).clamp(max=250), moisture)


def _dried(moisture: Tensor, temperature: Tensor, humidity: Tensor, wind_speed: Tensor, pace: Number) -> Tensor:
    """Return the moisture [per cent] on its way to the two equilibria, of drying and of wetting (eqs. 4 to 9)."""
    damp, wind = humidity / 100, torch.sqrt(KMH * wind_speed)
    warm = 0.18 * (21.1 - temperature) * -torch.expm1(-0.115 * humidity)
    drying = 0.942 * humidity**0.679 + 11 * torch.exp((humidity - 100) / 10) + warm
    wetting = 0.618 * humidity**0.753 + 10 * torch.exp((humidity - 100) / 10) + warm
    pace = pace * torch.exp(0.0365 * temperature)
    loss = pace * (0.424 * (1 - damp**1.7) + 0.0694 * wind * (1 - damp**8))
    gain = pace * (0.424 * (1 - (1 - damp) ** 1.7) + 0.0694 * wind * (1 - (1 - damp) ** 8))
    drier = drying + (moisture - drying) * 10**-loss
    wetter = wetting + (moisture - wetting) * 10**-gain
    return torch.where(moisture > drying, drier, torch.where(moisture < wetting, wetter, moisture))


def daily_dmc(
    dmc: Tensor, temperature: Tensor, humidity: Tensor, rain: Tensor, month: Tensor, latitude: Tensor
) -> Tensor:
    """Return the duff moisture code a day later (eqs. 11 to 17)."""
    day = _DUFF_DAYS[torch.bucketize(latitude, _DUFF_LATITUDES), month - 1]
    dried = 1.894e-4 * (temperature.clamp(min=-1.1) + 1.1) * (100 - humidity) * day
    logarithm = torch.log(dmc.clamp(min=1))
    slope = torch.where(dmc <= 65, 14 - 1.3 * logarithm, 6.2 * logarithm - 17.2)
    slope = torch.where(dmc <= 33, 100 / (0.5 + 0.3 * dmc), slope)
    net = (0.92 * rain - 1.27).clamp(min=0)
    moisture = 280 * torch.exp(-0.023 * dmc) + 1000 * net / (48.77 + slope * net)  # above the 20 per cent that stay
    wetted = (43.43 * (5.6348 - torch.log(moisture))).clamp(min=0)
    return torch.where(rain > 1.5, wetted, dmc) + dried


def daily_dc(dc: Tensor, temperature: Tensor, rain: Tensor, month: Tensor, latitude: Tensor) -> Tensor:
    """Return the drought code a day later (eqs. 18 to 23)."""
    day = _DROUGHT_DAYS[torch.bucketize(latitude, _DROUGHT_LATITUDES), month - 1]
    dried = ((0.36 * (temperature.clamp(min=-2.8) + 2.8) + day) / 2).clamp(min=0)
    net = (0.83 * rain - 1.27).clamp(min=0)
    wetted = (dc - 400 * torch.log1p(3.937 * net / (800 * torch.exp(-dc / 400)))).clamp(min=0)
    return torch.where(rain > 2.8, wetted, dc) + dried


def initial_spread_index(ffmc: Tensor, wind_speed: Tensor) -> Tensor:
    """Return the initial spread index in a wind [m/s] (eqs. 24 to 26)."""
    moisture = _moisture(ffmc, DAILY_SCALE)
    fine = 91.9 * torch.exp(-0.1386 * moisture) * (1 + moisture**5.31 / 4.93e7)
    return 0.208 * fine * torch.exp(0.05039 * KMH * wind_speed)


def buildup_index(dmc: Tensor, dc: Tensor) -> Tensor:
    """Return the buildup index (eqs. 27a and 27b)."""
    both = (dmc + 0.4 * dc).clamp(min=1e-6)
    dry = 0.8 * dmc * dc / both
    wet = dmc - (1 - 0.8 * dc / both) * (0.92 + (0.0114 * dmc) ** 1.7)
    return torch.where(dmc <= 0.4 * dc, dry, wet.clamp(min=0))


def fire_weather_index(isi: Tensor, bui: Tensor) -> Tensor:
    """Return the fire weather index (eqs. 28 to 30)."""
    duff = torch.where(bui > 80, 1000 / (25 + 108.64 * torch.exp(-0.023 * bui)), 0.626 * bui**0.809 + 2)
    product = 0.1 * isi * duff
    return torch.where(product > 1, torch.exp(2.72 * (0.434 * torch.log(product.clamp(min=1))) ** 0.647), product)
