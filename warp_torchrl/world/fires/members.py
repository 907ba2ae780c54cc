"""Members of an ensemble: fires that differ in rate, wind and moisture from the law and the weather."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, normal
from warp_torchrl.world.behaviour.moistures import MOISTURES, moisture_row
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape

PARAMETERS = ("rate", "wind_speed", "bearing", "moisture")
_DEAD = 3  # moistures of dead fuel, the first of ``MOISTURES``
_FFMC = list(MOISTURES).index("ffmc")
_STRONGEST = 40.0  # wind [m/s] that no member is over


@dataclass(frozen=True, kw_only=True)
class Deviations:
    """How far members differ before anything is seen.

    Attributes:
        rate: Coefficient of variation of the factor on all rates. Of 49 data sets a good model's error was 0.35 (Cruz
            and Alexander 2013).
        wind_speed: Coefficient of variation of the factor on the wind's speed.
        bearing: Standard deviation of the turn of the wind's bearing [degrees].
        moisture: Coefficient of variation of the factor on the moisture of dead fuel.

    Raises:
        ValueError: If a value is out of its range.
    """

    rate: float = 0.4
    wind_speed: float = 0.25
    bearing: float = 20.0
    moisture: float = 0.15

    def __post_init__(self) -> None:
        check_fields(self, rate=(0.0, 2.0), wind_speed=(0.0, 2.0), bearing=(0.0, 180.0), moisture=(0.0, 1.0))

    @property
    def scales(self) -> Tensor:
        """Return standard deviations in the order of ``PARAMETERS``, of logarithms but for the bearing, float32 [4]."""
        logs = [math.sqrt(math.log1p(each**2)) for each in (self.rate, self.wind_speed, self.moisture)]
        return torch.tensor([logs[0], logs[1], self.bearing, logs[2]])


@dataclass(frozen=True, eq=False)
class Members:
    """An ensemble on one map: K fires, each with its parameters.

    Attributes:
        values: Logarithms of the factors on rate and wind speed, the turn of the wind's bearing [degrees clockwise],
            and the logarithm of the factor on the moisture of dead fuel, float32 [K, 4].
    """

    values: Tensor

    @classmethod
    def drawn(cls, key: Tensor, deviations: Deviations) -> "Members":
        """Return members whose factors have median 1 and whose turns have mean 0.

        Args:
            key: Of the members, int64 [K].
            deviations: How far they differ.
        """
        return cls(normal(key, 0, Stream.MEMBERS, (len(PARAMETERS),)) * deviations.scales)

    @classmethod
    def plain(cls, count: int = 1) -> "Members":
        """Return members of the law and the weather as given."""
        return cls(torch.zeros(count, len(PARAMETERS)))

    def __len__(self) -> int:
        return len(self.values)

    @property
    def rate(self) -> Tensor:
        """Return the factors on all rates, float32 [K]."""
        return self.values[:, 0].exp()

    @property
    def wind_speed(self) -> Tensor:
        """Return the factors on the wind's speed, float32 [K]."""
        return self.values[:, 1].exp()

    @property
    def bearing(self) -> Tensor:
        """Return the turns of the wind's bearing [degrees clockwise], float32 [K]."""
        return self.values[:, 2]

    @property
    def moisture(self) -> Tensor:
        """Return the factors on the moisture of dead fuel, float32 [K]."""
        return self.values[:, 3].exp()

    def taken(self, index: Tensor) -> "Members":
        """Return the members of these places, int64 [K]."""
        return Members(self.values[index])

    def fires(
        self,
        fire: RateFire,
        landscape: Landscape,
        spells: Sequence[Spell],
        cell_size: float,
        half_way: Tensor | None = None,
    ) -> Fires:
        """Return the members' fires on a map, one of each.

        Args:
            fire: The law.
            landscape: One landscape, batch size [1].
            spells: The weather, one for all.
            cell_size: Side of a cell [m].
            half_way: See ``Fires``.
        """
        met = spells if not bool(self.values[:, 1:].any()) else [self._spell(fire, spell) for spell in spells]
        rate = self.rate
        return Fires(
            fire=fire,
            landscape=landscape,
            spells=met,
            cell_size=cell_size,
            rate=rate if bool(self.values[:, 0].any()) else None,
            swiftest=max(1.0, float(rate.max())),
            half_way=half_way,
        )

    def _spell(self, fire: RateFire, spell: Spell) -> Spell:
        """Return a spell with the wind and the moisture of each member."""
        row = moisture_row(fire.moisture)
        moisture = row if spell.moisture is None else torch.where(spell.moisture.isnan(), row, spell.moisture)
        winds, moistures = self.winds(spell.wind), self.moistures(moisture)
        strongest = winds[winds.square().sum(1).argmax()]
        driest = moisture.clone()
        driest[:_DEAD], driest[_FFMC] = moistures[:, :_DEAD].amin(0), moistures[:, _FFMC].max()
        return replace(spell, wind=winds, moisture=moistures, fastest=replace(spell, wind=strongest, moisture=driest))

    def winds(self, wind: Tensor) -> Tensor:
        """Return each member's wind, float32 [K, 2] [m/s], from (u east, v north), float32 [2]."""
        angle = torch.deg2rad(self.bearing)
        east, north = wind
        turned = torch.stack((east * angle.cos() + north * angle.sin(), north * angle.cos() - east * angle.sin()), 1)
        found = turned * self.wind_speed[:, None]
        speed = found.square().sum(1, keepdim=True).clamp(min=1e-12).sqrt()
        return found * (_STRONGEST / speed).clamp(max=1.0)

    def moistures(self, row: Tensor) -> Tensor:
        """Return each member's moistures, float32 [K, 7], from a row in the order of ``MOISTURES``, float32 [7].

        The fine fuel moisture code stands for a moisture m = 147.2 (101 - F) / (59.5 + F) (Van Wagner 1987, eq. 1).
        """
        found = row.expand(len(self), -1).clone()
        found[:, :_DEAD] = (found[:, :_DEAD] * self.moisture[:, None]).clamp(1.0, 200.0)
        fine = 147.2 * (101.0 - row[_FFMC]) / (59.5 + row[_FFMC]) * self.moisture
        found[:, _FFMC] = 59.5 * (250.0 - fine.clamp(max=250.0)) / (147.2 + fine)
        return found
