"""Moisture of dead fuel from temperature and humidity, for rates of spread that depend on it by size of fuel."""

import torch
from torch import Tensor

RAINING = 35.0
"""Moisture of the finest fuel while it rains [per cent] (Cohen and Deeming 1985, PSW-82)."""


def equilibrium_moisture(temperature: Tensor, humidity: Tensor) -> Tensor:
    """Return the equilibrium moisture of wood in air [per cent] (Simard 1968, FF-X-14).

    Args:
        temperature: Of the air [C].
        humidity: Of the air [per cent].
    """
    warm = 1.8 * temperature + 32
    arid = 0.03229 + 0.281073 * humidity - 0.000578 * humidity * warm
    middle = 2.22749 + 0.160107 * humidity - 0.014784 * warm
    humid = 21.0606 + 0.005565 * humidity**2 - 0.00035 * humidity * warm - 0.483199 * humidity
    return torch.where(humidity < 10, arid, torch.where(humidity < 50, middle, humid)).clamp(min=0)


def dead_moisture(temperature: Tensor, humidity: Tensor, rain: Tensor | None = None) -> tuple[Tensor, Tensor, Tensor]:
    """Return the moisture of dead fuel of 1, 10 and 100 hours, each of the arguments' shape [per cent].

    Of 1 hour: 1.03 times the equilibrium (Fosberg and Deeming 1971, RM-207; the fuel lies in shade). Of 10 and 100
    hours: one and two per cent more, as is the custom where nothing else is known (Rothermel 1983, INT-143).

    Args:
        temperature: Of the air [C].
        humidity: Of the air [per cent].
        rain: Where it rains the finest fuel is wet [mm]; None where that is not known.
    """
    finest = 1.03 * equilibrium_moisture(temperature, humidity)
    if rain is not None:
        finest = torch.where(rain > 0, RAINING, finest)
    return finest, finest + 1, finest + 2
