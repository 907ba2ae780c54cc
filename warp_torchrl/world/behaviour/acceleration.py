"""Acceleration of young fires: a fire from a point reaches its rate of spread by and by.

    R(t) = R (1 - exp(-a t)),   a = 0.115 in open fuel,   a = 0.115 - 18.8 C^2.5 exp(-8 C) under a canopy

t is the time since ignition in minutes and C the share of crowns that burn (Forestry Canada 1992, ST-X-3, eqs. 70 to
72; McAlpine and Wakimoto 1989). At 0.115 it has nine tenths of its rate after 20 minutes. Length to breadth stays that
of the steady fire.
"""

from dataclasses import replace

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.spread import Spread

OPEN = 0.115
"""a in open fuel [1/min]; Finney (1998, RMRS-RP-4) has it in all of Rothermel's."""
YOUNG = 240.0
"""Minutes after which the slowest has its rate, within a tenth of a per cent."""


def under_canopy(crowns: Tensor) -> Tensor:
    """Return a under a canopy, by the share of crowns that burn [1/min]; it is least, 0.031, where a third does."""
    return OPEN - 18.8 * crowns**2.5 * torch.exp(-8.0 * crowns)


def mean_share(rate: Tensor | float, begin: float, end: float) -> Tensor:
    """Return the mean of 1 - exp(-a t) from one minute to another, which makes the way between them exact.

    Args:
        rate: a [1/min].
        begin: The first minute since ignition.
        end: The last, after the first.
    """
    a = torch.as_tensor(rate)
    return 1.0 - (torch.exp(-a * begin) - torch.exp(-a * end)) / (a * (end - begin))


def slowed(spread: Spread, share: Tensor) -> Spread:
    """Return a spread at a share of its rate: intensity goes with it, flames with its power of 0.46 (Byram 1959)."""
    return replace(
        spread,
        head=spread.head * share,
        intensity=spread.intensity * share,
        flame_length=spread.flame_length * share**0.46,
    )
