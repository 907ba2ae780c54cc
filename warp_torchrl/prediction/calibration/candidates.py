"""Several laws on one fire at once: groups of worlds, each with the rates of its law."""

from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.world.backends.spreading import Hour, Spreading
from warp_torchrl.world.fires.spell import Spell, can_ignite, hour_of
from warp_torchrl.world.law.rate import RateFire


def burnable(fire: RateFire, case: FireCase) -> Tensor:
    """Return the cells of a case that can ignite, bool [H, W]."""
    return can_ignite(fire, case.landscape)


def arrivals(fires: Sequence[RateFire], case: FireCase, pace: Tensor) -> Tensor:
    """Return when the fires of each law reach each cell, float32 [G, F, H, W] [minutes], ``travel.NEVER`` if never.

    Args:
        fires: G laws; they differ in factors and moistures alone.
        case: Where and when.
        pace: Factor on the times of each law's F fires, float32 [G, F, H, W].
    """
    fuel = burnable(fires[0], case)
    groups, each, height, width = pace.shape
    worlds = Spreading(case.lit.expand(groups * each, height, width), fuel, pace.reshape(-1, height, width))
    worlds.burn(grouped(fires, case, spell, fuel) for spell in case.spells)
    return worlds.arrival().reshape(groups, each, height, width)


def grouped(fires: Sequence[RateFire], case: FireCase, spell: Spell, fuel: Tensor) -> Hour:
    """Return the travel times of each law in a spell, with the shortest tick that any of the laws needs."""
    hours = [hour_of(fire, case.landscape, case.cell_size, spell, fuel) for fire in fires]
    ticks = max(hour.ticks for hour in hours)
    return Hour(torch.stack([hour.travel for hour in hours]), spell.minutes / ticks, ticks)


def paces(fires: Sequence[RateFire], key: Tensor, size: tuple[int, int]) -> Tensor:
    """Return the drawn factors on each law's times, the same draws for each, float32 [G, F, H, W].

    Args:
        fires: G laws.
        key: Of the fires, int64 [F].
        size: (H, W).
    """
    return torch.stack([fire.pace(key, size) for fire in fires])


def median_pace(fires: Sequence[RateFire], case: FireCase) -> Tensor:
    """Return ones, float32 [G, 1, H, W]: the fire of median rates alone."""
    return torch.ones(len(fires), 1, *case.lit.shape)
