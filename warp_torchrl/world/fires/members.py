"""Members of an ensemble: fires that differ in rate, wind and moisture from the law and the weather."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import turned
from warp_torchrl.world.arrays.random import Stream, log_deviation, normal, uniform
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.behaviour.moistures import MOISTURES, in_force, moisture_row
from warp_torchrl.world.ensemble.parameters import PARAMETERS, Deviations
from warp_torchrl.world.fires.alone import AT_ONCE, Fires
from warp_torchrl.world.fires.pieces import gust_factors
from warp_torchrl.world.fires.sectors import SECTORS, STOPPED, sectors_about
from warp_torchrl.world.fires.spell import Spell, can_ignite, spread_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

_DEAD = 3  # moistures of dead fuel, the first of ``MOISTURES``
_FFMC = list(MOISTURES).index("ffmc")
_STRONGEST = 40.0  # wind [m/s] that no member is over
_WIDEST = 2.0  # standard deviations of rates from sector to sector


@dataclass(frozen=True, eq=False)
class Members:
    """An ensemble on one map: K fires, each with its parameters.

    Attributes:
        values: In the order of ``PARAMETERS``, float32 [K, 4].
        local: Factor on the rates in each sector, float32 [K, S]; None is 1.
        held: Sectors in which a member does not advance, bool [K, S]; None: it does in all.
        sector: The sector of each cell, int64 [H, W]; None where nothing differs by sector.
        gusts: Keys by which each draws its wind in spells with a ``block``, int64 [K]; None: none does.
    """

    values: Tensor
    local: Tensor | None = None
    held: Tensor | None = None
    sector: Tensor | None = None
    gusts: Tensor | None = None

    @classmethod
    def drawn(cls, key: Tensor, deviations: Deviations, lit: Tensor) -> "Members":
        """Return members whose factors have median 1 and whose turns have mean 0.

        Args:
            key: Of the members, int64 [K].
            deviations: How far they differ.
            lit: What burns or has burned when they begin, bool [H, W].
        """
        held = torch.full((SECTORS,), deviations.held)
        return cls(deviations.drawn(key)).by_sector(key, 0, deviations.local, held, sectors_about(lit))

    @classmethod
    def by_rate(cls, key: Tensor, deviation: float) -> "Members":
        """Return members that differ in the rate alone, one in each of K equal parts of its distribution.

        Drawn freely, a hundred factors of deviation 0.4 would have a median that is off by 5 %.

        Args:
            key: Of the members, int64 [K]: it orders them.
            deviation: Coefficient of variation of the factor.
        """
        rank = normal(key, 0, Stream.MEMBERS, (len(PARAMETERS),))[:, 0].argsort().argsort()
        parts = torch.special.ndtri((rank.double() + 0.5) / len(key)).to(torch.float32)
        values = torch.zeros(len(key), len(PARAMETERS))
        values[:, 0] = log_deviation(deviation) * parts
        return cls(values)

    @classmethod
    def plain(cls, count: int = 1) -> "Members":
        """Return members of the law and the weather as given."""
        return cls(torch.zeros(count, len(PARAMETERS)))

    def by_sector(self, key: Tensor, tick: int, local: float, held: Tensor, sector: Tensor) -> "Members":
        """Return members that differ from sector to sector of the front, too.

        Args:
            key: Of the members, int64 [K].
            tick: Of the draws.
            local: Coefficient of variation of the rates.
            held: Chance of each sector that it does not advance, float32 [S].
            sector: The sector of each cell, int64 [H, W].
        """
        draws = normal(key, tick, Stream.SECTORS, (SECTORS,)).clamp(-_WIDEST, _WIDEST)
        chance = uniform(key, tick, Stream.HELD, (SECTORS,))
        return Members(self.values, (log_deviation(local) * draws).exp(), chance < held, sector)

    def by_pace(self) -> Tensor:
        """Return the order in which members of like rates stand side by side, in groups that burn at once, int64 [K].

        The members of a group keep their order.
        """
        order = self.rate.argsort(stable=True)
        return torch.cat([group.sort().values for group in self._groups(order)])

    def _swift(self) -> Tensor:
        """Return the highest rate in the group of each member, float32 [K], of members that stand ``by_pace``."""
        return torch.cat([group.max().expand(len(group)) for group in self._groups(self.rate)])

    def _groups(self, values: Tensor) -> tuple[Tensor, ...]:
        return values.chunk(-(-len(values) // AT_ONCE))

    def part(self, members: slice | Tensor) -> "Members":
        """Return some of the members, or all in another order."""
        local, held = (None if each is None else each[members] for each in (self.local, self.held))
        gusts = None if self.gusts is None else self.gusts[members]
        return Members(self.values[members], local, held, self.sector, gusts)

    def stopped(self, arrival: Tensor) -> Tensor:
        """Return times of arrival where sectors are held, float32 [K, H, W], of members in which none was."""
        if self.held is None or self.sector is None:
            return arrival
        held = self.held.index_select(1, self.sector.flatten()).view_as(arrival)
        return arrival.masked_fill(held & (arrival > 0.0), NEVER)

    @property
    def open(self) -> "Members":
        """Return the members as if no sector was held."""
        return replace(self, held=None)

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

    def fires(
        self,
        fire: RateFire,
        landscape: Landscape,
        spells: Sequence[Spell],
        cell_size: float,
        half_way: Tensor | None = None,
        embers: Firebrands | None = None,
        in_paces: bool = False,
        later: Tensor | None = None,
    ) -> Fires:
        """Return the members' fires on a map, one of each.

        Args:
            fire: The law.
            landscape: One landscape, batch size [1].
            spells: The weather, one for all.
            cell_size: Side of a cell [m].
            half_way: See ``Fires``.
            embers: See ``Fires``.
            in_paces: Whether the members stand ``by_pace``, and each group of them takes ticks as short as it needs.
            later: See ``Fires``.
        """
        differ = self.gusts is not None or bool(self.values[:, 1:].any())
        met = [self._spell(fire, spell) for spell in spells] if differ else spells
        rate = self._rates()
        return Fires(
            fire=fire,
            landscape=landscape,
            spells=met,
            cell_size=cell_size,
            rate=rate,
            sector=self.sector,
            swiftest=max(1.0, float(self.rate.max())),
            swift=self._swift() if in_paces and rate is not None else None,
            half_way=half_way,
            embers=embers,
            later=later,
        )

    def pace(self, fire: RateFire, landscape: Landscape, spell: Spell, cell_size: float, window: Window) -> Tensor:
        """Return the rate of each member's head over that of the law and the weather as given, float32 [K].

        It is the median over the cells of a window that have fuel; 1 where none has.
        """
        fuel = window.cut(can_ignite(fire, landscape), False)
        plain = spread_in(fire, landscape, cell_size, spell, window).head[0]
        asked = fuel & (plain > 0.0)
        if not bool(asked.any()):
            return torch.ones(len(self))
        heads = spread_in(fire, landscape, cell_size, self._spell(fire, spell), window).head
        return self.rate * (heads[:, asked] / plain[asked]).median(1).values

    def _rates(self) -> Tensor | None:
        """Return the factors on the rates of each member, float32 [K], or by sector [K, S]; None where all are 1."""
        rates = self.rate
        if self.sector is not None:
            rates = rates[:, None].expand(-1, SECTORS)
            rates = rates if self.local is None else rates * self.local
            rates = rates if self.held is None else torch.where(self.held, STOPPED, rates)
        return rates if bool((rates != 1.0).any()) else None

    def _spell(self, fire: RateFire, spell: Spell) -> Spell:
        """Return a spell with the wind and the moisture of each member."""
        moisture = in_force(spell.moisture, moisture_row(fire.moisture))
        winds, moistures = self._blown(spell), self.moistures(moisture)
        strongest = winds[winds.square().sum(1).argmax()]
        driest = moisture.clone()
        driest[:_DEAD], driest[_FFMC] = moistures[:, :_DEAD].amin(0), moistures[:, _FFMC].max()
        return replace(spell, wind=winds, moisture=moistures, fastest=replace(spell, wind=strongest, moisture=driest))

    def _blown(self, spell: Spell) -> Tensor:
        """Return each member's wind in a spell, in its gusts where it has some, float32 [K, 2] [m/s]."""
        winds = self.winds(spell.wind)
        if self.gusts is None or spell.block is None:
            return winds
        return winds * gust_factors(self.gusts, spell)[:, None]

    def winds(self, wind: Tensor) -> Tensor:
        """Return each member's wind, float32 [K, 2] [m/s], from (u east, v north), float32 [2]."""
        found = turned(wind[None], -torch.deg2rad(self.bearing)) * self.wind_speed[:, None]
        speed = found.square().sum(1, keepdim=True).clamp(min=1e-12).sqrt()
        return found * (_STRONGEST / speed).clamp(max=1.0)

    def moistures(self, row: Tensor) -> Tensor:
        """Return each member's moistures, float32 [K, 7], from a row in the order of ``MOISTURES``, float32 [7].

        The fine fuel moisture code stands for a moisture m, F = 59.5 (250 - m) / (147.2 + m) (Van Wagner 1987, eq. 10).
        """
        found = row.expand(len(self), -1).clone()
        found[:, :_DEAD] = (found[:, :_DEAD] * self.moisture[:, None]).clamp(1.0, 200.0)
        fine = (59.5 * 250.0 - 147.2 * row[_FFMC]) / (59.5 + row[_FFMC]) * self.moisture
        found[:, _FFMC] = 59.5 * (250.0 - fine.clamp(max=250.0)) / (147.2 + fine)
        return found
