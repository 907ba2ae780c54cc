"""Rates at which crews and bulldozers build fireline, by fuel model and slope.

Sources of the National Wildfire Coordinating Group (NWCG): sustained rates of crews of 20 with hand tools, for
construction, burnout and holding, from the Incident Response Pocket Guide, PMS 461, with which they were compared;
rates of a type 3 bulldozer (90 to 165 hp) in a single pass, after the Equipment Technology Committee's page on dozers,
with which they were not: take them as ours. Fuels have Anderson's numbers
(``world.law.anderson``).
"""

from collections.abc import Mapping
from typing import Literal, get_args

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.law.anderson import NUMBERS, anderson_numbers
from warp_torchrl.world.law.listed import gradient
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.state import WorldState

Builder = Literal["crew1", "crew2", "dozer"]
"""Who builds line: a crew of 20 of type 1 or 2, a bulldozer of type 3."""
BUILDERS: tuple[Builder, ...] = get_args(Builder)
CHAIN = 20.1168
"""Metres in a chain."""
SLOPES = (25.0, 40.0, 55.0, 74.0)
"""Upper bounds of the classes of slope [%]; nobody builds line on steeper ground."""
_FUELS = NUMBERS + 1  # 0 is none
_CLASSES = len(SLOPES) + 1
_CREWS: Mapping[Builder, tuple[float, ...]] = {
    "crew1": (30, 24, 5, 5, 6, 6, 4, 7, 28, 6, 15, 7, 5),
    "crew2": (18, 16, 3, 3, 4, 4, 2, 5, 16, 4, 9, 4, 3),
}
"""Chains an hour in fuel models 1..13, in grass and conifers where the source tells several, on any slope."""
_DOZER: Mapping[tuple[int, ...], tuple[tuple[float, float, float, float], ...]] = {
    (1, 2): ((55, 90, 90, 110), (30, 55, 90, 110), (8, 30, 20, 90), (0, 8, 0, 20)),
    (3, 5, 8): ((45, 70, 70, 80), (25, 45, 65, 80), (2, 25, 0, 65), (0, 2, 0, 0)),
    (4,): ((20, 35, 35, 40), (10, 20, 25, 40), (0, 10, 0, 25), (0, 0, 0, 0)),
    (6, 7, 9): ((35, 55, 55, 60), (15, 35, 40, 60), (0, 15, 0, 40), (0, 0, 0, 0)),
    (11, 12): ((15, 25, 25, 30), (7, 15, 10, 30), (0, 7, 0, 10), (0, 0, 0, 0)),
    (10, 13): ((8, 15, 10, 15), (3, 8, 5, 10), (0, 3, 0, 5), (0, 0, 0, 0)),
}
"""Chains an hour of each class of slope: least and most up the slope, and down it. The mean of the four holds."""


def kinds_of(state: WorldState, world: Rules) -> Tensor:
    """Return the kind of ground of each cell, uint8 [B, H, W]: its number of fuel and its class of slope."""
    fuel, cover = anderson_numbers(world.fire, state.landscape), state.cover
    rise = gradient(state.landscape.elevation, cover, state.ground.cell_size)
    steep = 100.0 * torch.sqrt(rise[:, 0] * rise[:, 0] + rise[:, 1] * rise[:, 1])
    return (fuel * _CLASSES + torch.bucketize(steep, numbers(SLOPES, steep.device))).to(torch.uint8)


def metres_a_minute(kind: Tensor, builder: Tensor) -> Tensor:
    """Return how fast builders, by their index in ``BUILDERS``, build line on kinds of ground, float32 [m/min].

    Of the index after the last it is 0.
    """
    return numbers(_RATES, kind.device)[builder * (_FUELS * _CLASSES) + kind.long()]


def _chains_an_hour(builder: Builder, fuel: int, slope: int) -> float:
    if fuel == 0 or slope == len(SLOPES):
        return 0.0
    if builder != "dozer":
        return _CREWS[builder][fuel - 1]
    rates = next(each for fuels, each in _DOZER.items() if fuel in fuels)
    return sum(rates[slope]) / len(rates[slope])


_RATES = (
    *(
        _chains_an_hour(builder, fuel, slope) * CHAIN / 60.0
        for builder in BUILDERS
        for fuel in range(_FUELS)
        for slope in range(_CLASSES)
    ),
    *[0.0] * (_FUELS * _CLASSES),
)
"""Metres a minute by builder, fuel and slope."""
