"""Wind adjustment: from the wind of a weather station to the wind at midflame height.

Sources: Albini and Baughman 1979 (INT-221); Andrews 2012 (RMRS-GTR-266), "Modeling wind adjustment factor and midflame
wind speed for Rothermel's surface fire spread model".
"""

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.fuel_models import FOOT

TEN_METRES = 1.15
"""The wind at 10 m over that at 20 ft (6.1 m) above the vegetation (Lawson and Armitage 2008; Andrews 2012)."""
LEAST_COVER = 15.0
"""Canopy cover [%] times crown ratio from which crowns shelter: they then fill 5 % of the space (Andrews 2012)."""
LEAST_HEIGHT = 6.0
"""Height of a canopy that shelters [ft]; as in BehavePlus and pyretechnics."""


def wind_adjustment_factor(depth: Tensor, canopy_cover: Tensor, canopy_height: Tensor, crown_ratio: Tensor) -> Tensor:
    """Return the midflame wind over the wind at 20 ft, of the shape that all arguments broadcast to.

    Args:
        depth: Of the fuel bed [ft].
        canopy_cover: Ground under crowns seen from above [%].
        canopy_height: [m].
        crown_ratio: Length of the crowns over the height of the trees, in (0, 1].
    """
    height = canopy_height / FOOT
    is_sheltered = (canopy_cover * crown_ratio >= LEAST_COVER) & (height >= LEAST_HEIGHT)
    return torch.where(is_sheltered, sheltered_factor(canopy_cover, height, crown_ratio), open_factor(depth))


def open_factor(depth: Tensor) -> Tensor:
    """Return the factor over a fuel bed [ft] without trees; 0 where there is no fuel (Andrews 2012 eq. 6)."""
    there = torch.where(depth > 0.0, depth, 1.0)
    return torch.where(depth > 0.0, 1.83 / torch.log((20.0 + 0.36 * there) / (0.13 * there)), 0.0)


def sheltered_factor(canopy_cover: Tensor, height: Tensor, crown_ratio: Tensor) -> Tensor:
    """Return the factor under a canopy (Andrews 2012 eq. 2): the fuel bed below it does not matter.

    Args:
        canopy_cover: [%].
        height: Of the canopy [ft].
        crown_ratio: In (0, 1].
    """
    filled = (canopy_cover * crown_ratio).clamp(min=LEAST_COVER) / 300.0
    height = height.clamp(min=LEAST_HEIGHT)
    return 0.555 / (torch.sqrt(filled * height) * torch.log((20.0 + 0.36 * height) / (0.13 * height)))
