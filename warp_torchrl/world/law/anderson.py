"""Fuels by the numbers of Anderson (1982), in which handbooks of firefighting tell of them.

The tables that lead other fuel models to these are our reading of their descriptions.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import whole_numbers
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.fuel_bed import COVER_FUEL
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape

NUMBERS = 13
"""The highest number; 0 is no fuel."""
_LIKE: Mapping[str, Mapping[int, tuple[int, ...]]] = {
    "fbfm13": {model: (model,) for model in range(1, 14)},
    "fbfm40": {
        1: (101, 102, 103, 104),
        2: (121, 122),
        3: (105, 106, 107, 108, 109),
        4: (124, 145, 147, 149),
        5: (123, 141, 142),
        6: (143, 144, 146),
        7: (148, 163),
        8: (181, 183, 184, 161),
        9: (182, 186, 188, 189),
        10: (162, 164, 165, 185, 187),
        11: (201,),
        12: (202, 203),
        13: (204,),
    },
    "fbp": {
        1: (31, 32),
        8: (1, 3, 5, 6),
        9: (7, 11, 12, 13),
        10: (2, 4, 40, 50, 60, 70, 80, 90, *range(400, 1000)),
        12: (21, 22),
        13: (23,),
    },
}
"""Codes of each model's fuels by number."""
_CODES = 1000  # of fuels of any model


def anderson_numbers(fire: Automaton, landscape: Landscape) -> Tensor:
    """Return the number of the fuel of each cell, int64 [B, H, W].

    Under law ``rate`` the fuel is that of the map; ground of a code that is not known has the fuel of its cover, and so
    has all ground under other laws.
    """
    cover = landscape.cover
    fuel = whole_numbers(COVER_FUEL["fbfm13"], cover.device)[cover.long()]
    if isinstance(fire, RateFire):
        codes = fire.bed.fuel(landscape).long().clamp(0, _CODES - 1)
        found = whole_numbers(numbers_of("" if fire.fuel_models else fire.model), cover.device)[codes]
        fuel = torch.where(found > 0, found, fuel)
    return torch.where(fuel <= NUMBERS, fuel, 0)


def numbers_of(model: str) -> tuple[int, ...]:
    """Return the number of each code of a model's fuels, 0 where there is none."""
    of_code = {code: number for number, codes in _LIKE.get(model, {}).items() for code in codes}
    return tuple(of_code.get(code, 0) for code in range(_CODES))
