"""Spells in pieces: the first hours of a fire that accelerates, and the minutes of a wind with gusts."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, normal
from warp_torchrl.world.behaviour.acceleration import YOUNG
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.weather.table import WeatherTable

_AGES = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 180.0, YOUNG)
"""Minutes since ignition between which a young fire's rates are constant, at their mean."""
_PEAK = 2.4
_SHORTEST = 1e-6  # minutes


@dataclass(frozen=True, kw_only=True)
class Gusts:
    """Winds that each fire draws about the mean of a row.

    Rates of spread are those of the mean wind, and the mean of the draws is that. Every ``minutes`` a fire has another
    factor on the wind's speed, log-normal of mean 1, and at most G, the gust over the mean. Its standard deviation is
    (G - 1) / 2.4: by 2.4 of them a gust of 3 seconds exceeds the mean of ten minutes (Wieringa 1973, at 10 m/s).
    ELMFIRE draws winds every few minutes too, with an intensity that the user gives.

    Attributes:
        minutes: Between draws.
        factor: G where the weather has no column of gusts; None: it must have one.

    Raises:
        ValueError: If a value is out of its range.
    """

    minutes: float = 10.0
    factor: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, minutes=(1.0, 1440.0), factor=(1.0, 5.0))

    def check(self, table: WeatherTable) -> None:
        """Refuse a weather without gusts where no factor is given.

        Raises:
            ValueError: If so.
        """
        if self.factor is None and table.wind_gust is None:
            raise ValueError("gusts needs a column of gusts in the weather, or gustiness.factor, got neither")

    def blocks(self, spells: Sequence[Spell], first: int = 0) -> list[Spell]:
        """Return spells cut into the times of draws, where there are gusts.

        Args:
            spells: The weather.
            first: Number of the first block; other numbers are other draws.
        """
        made: list[Spell] = []
        for spell in spells:
            gust = spell.gust if self.factor is None else self.factor
            parts = _cut(spell, self._ends(spell.minutes) if gust > 1.0 else ())
            before = first + len(made)
            made += [replace(part, gust=gust, block=before + number) for number, part in enumerate(parts)]
        return made

    def _ends(self, minutes: float) -> Iterable[float]:
        return (self.minutes * number for number in range(1, math.ceil(minutes / self.minutes)))


def gust_factors(key: Tensor, spell: Spell) -> Tensor:
    """Return the factor on each fire's wind in a block, float32 [K].

    Args:
        key: Of the fires, int64 [K].
        spell: With the number of the block.
    """
    variance = math.log1p(((spell.gust - 1.0) / _PEAK) ** 2)
    draws = normal(key, spell.block or 0, Stream.GUST, (1,))[:, 0]
    return torch.exp(math.sqrt(variance) * draws - 0.5 * variance).clamp(max=spell.gust)


def from_ignition(spells: Sequence[Spell]) -> list[Spell]:
    """Return spells cut at the ages of a fire that accelerates, lit as the first begins."""
    made, age = [], 0.0
    for spell in spells:
        for part in _cut(spell, (at - age for at in _AGES)):
            young = (age, age + part.minutes) if age < YOUNG else None
            made.append(replace(part, young=young))
            age += part.minutes
    return made


def _cut(spell: Spell, ends: Iterable[float]) -> list[Spell]:
    """Return the parts of a spell that end at some minutes of it, rising; those outside are left."""
    within = [end for end in ends if _SHORTEST < end < spell.minutes - _SHORTEST]
    begins = [0.0, *within]
    return [replace(spell, minutes=end - begin) for begin, end in zip(begins, [*within, spell.minutes], strict=True)]
