"""Several laws on one fire at once: groups of fires, each with the rates of its law."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.spell import can_ignite
from warp_torchrl.world.law.rate import RateFire


def burnable(fire: RateFire, case: FireCase) -> Tensor:
    """Return the cells of a case that can ignite, bool [H, W]."""
    return can_ignite(fire, case.landscape)


def fires_of(laws: Sequence[RateFire], case: FireCase) -> Fires:
    """Return the fires of some laws on a case; the laws differ in factors, deviations and moistures alone."""
    return Fires(fire=laws[0], beside=laws[1:], landscape=case.landscape, spells=case.spells, cell_size=case.cell_size)


def arrivals(laws: Sequence[RateFire], case: FireCase, key: Tensor) -> Tensor:
    """Return when the fires of each law reach each cell, float32 [G, F, H, W] [minutes], ``travel.NEVER`` if never.

    Args:
        laws: G laws, see ``fires_of``.
        case: Where and when.
        key: Of each law's fires, int64 [F]: the same draws of rates for each law.
    """
    parts = fires_of(laws, case).in_parts(case.lit, key.repeat(len(laws)), on_map)
    return torch.cat(list(parts)).unflatten(0, (len(laws), len(key)))


def median_arrivals(laws: Sequence[RateFire], case: FireCase) -> Tensor:
    """Return when the fire of each law's median rates reaches each cell, float32 [G, 1, H, W] [minutes]."""
    still = [replace(law, cell_deviation=0.0, fire_deviation=0.0) for law in laws]
    return arrivals(still, case, world_key(torch.zeros(1, dtype=torch.int64)))
