"""Fires without vehicles under law ``rate``: many on one map, in hourly weather, from ignition to an end."""

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TypeVar

import torch
from torch import Tensor

from warp_torchrl.world.backends.growing import Embers, GrowingFires, Land, SpellInWindows
from warp_torchrl.world.backends.spells import PlanesOfSpells, in_window, strips
from warp_torchrl.world.backends.spreading import Hour
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.fires.fastest import RowsOfMap, fastest_heads, heads_of_strips
from warp_torchrl.world.fires.later import LaterFires
from warp_torchrl.world.fires.paces import drawn_paces, rates_in
from warp_torchrl.world.fires.parts import Division, Ended, check_memory
from warp_torchrl.world.fires.pieces import from_ignition
from warp_torchrl.world.fires.spell import Spell, air_in, can_ignite, heads, spread_in, ticks_of
from warp_torchrl.world.fires.spotting import EmberGround, SpotFires
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import travel
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

AT_ONCE = 256
"""Fires that burn at once at most: more take longer, for their planes leave a CPU's cache."""
_HEAD = 3  # planes of travel; then head, backing, intensity and flame length, and the kind of fire where crowns burn
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Burned:
    """Cells burned by some fires, in a window of the map."""

    window: Window
    minutes: Tensor  # when each fire reached each cell, float32 [b, h, w]; ``travel.NEVER`` where it does not come
    pace: Tensor  # factor on its times, float32 [b, h, w]
    fires: "Fires"  # whose planes are those of these fires' groups


@dataclass(frozen=True, kw_only=True, eq=False)
class Fires:
    """Fires without vehicles on one map, in weather by the spell. Everything is computed on demand.

    All fires have one law and one weather, or they form groups: of several laws, each with as many fires, or of one law
    in several winds and moistures (``Spell``). ``Members`` makes groups of one fire each.

    In each spell, ticks are as short as its fastest cells need; ``fire.minutes_per_tick`` is not read.

    Attributes:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        spells: The weather; of a law with acceleration cut into pieces, unless the fire burned before (``half_way``).
        cell_size: Side of a cell [m].
        beside: Further laws, each of another group of fires; they differ in factors, deviations and moistures alone.
        rate: Factor on the rates of each fire, float32 [B], or in each of S sectors, float32 [B, S]; None is 1.
        sector: The sector of each cell, int64 [H, W].
        swiftest: Highest of these factors; it shortens ticks.
        swift: Highest of the factors of the fires that each burns with, float32 [B], equal ones side by side, so that
            slow fires do not take the ticks of the swiftest one. None: all take ``swiftest``.
        half_way: Cells that the fire has come half-way to at the start, bool [H, W]: those about a perimeter, whose
            front is half a cell ahead of the last cell inside, on average; None where it starts in its cells' middle.
        embers: Firebrands that start fires ahead; None: none fly.
        later: When further cells are lit, float32 [H, W] [minutes], infinite where they are not; None: none are.
        root: All fires, where these are some of them (``of``).
        workers: Threads.
    """

    fire: RateFire
    landscape: Landscape
    spells: Sequence[Spell]
    cell_size: float
    beside: Sequence[RateFire] = ()
    rate: Tensor | None = None
    sector: Tensor | None = None
    swiftest: float = 1.0
    swift: Tensor | None = None
    half_way: Tensor | None = None
    embers: Firebrands | None = None
    later: Tensor | None = None
    root: "Fires | None" = field(default=None, repr=False)
    workers: int = field(default_factory=torch.get_num_threads)
    _lock: threading.Lock = field(init=False, repr=False, default_factory=threading.Lock)
    _fastest: dict[int, tuple[float, float]] = field(init=False, repr=False, default_factory=dict)
    _ended: threading.Event = field(init=False, repr=False, default_factory=threading.Event)

    def __post_init__(self) -> None:
        if self.fire.acceleration and self.half_way is None and self.root is None:
            object.__setattr__(self, "spells", from_ignition(self.spells))

    @property
    def size(self) -> tuple[int, int]:
        """Return (H, W) of the map."""
        return self.landscape.cover.shape[1], self.landscape.cover.shape[2]

    @property
    def n_met(self) -> int:
        """Return the number of spells from the first to the last in which a fire burned."""
        return len(self._fastest)

    @cached_property
    def fuel(self) -> Tensor:
        """Return the cells that can ignite, bool [H, W]."""
        return can_ignite(self.fire, self.landscape)

    @property
    def laws(self) -> tuple[RateFire, ...]:
        """Return the law of each group, or the one law."""
        return self.fire, *self.beside

    @property
    def groups(self) -> int:
        """Return the number of groups of fires that differ in law or weather."""
        return max(len(self.laws), *(spell.groups for spell in self.spells))

    @cached_property
    def runs_in_crowns(self) -> bool:
        """Return whether the map knows its crowns, and the law burns them."""
        return self.fire.bed.runs_in_crowns(self.landscape)

    @cached_property
    def _made(self) -> PlanesOfSpells:
        return PlanesOfSpells(lambda number, window: in_window(partial(self._planes, number), window))

    def planes(self, number: int, window: Window) -> Tensor:
        """Return the planes of each group in a spell and a window: three of ``travel``, then those of the heads.

        Returns:
            float32 [G, 7, h, w], or 8 where fires run in crowns; the heads as in ``passing.HeadBehaviour``.
        """
        if self.root is not None and self.root.groups == 1:
            return self.root.planes(number, window)
        made = self._made(number, window)
        return made.view(-1, 8 if self.runs_in_crowns else 7, *made.shape[1:])

    def fastest(self, number: int) -> tuple[float, float]:
        """Return the rates of a spell's fastest heads but one in a thousand [m/min], of the fastest group.

        Of the cells that can ignite, and of all cells.
        """
        if self.root is not None:
            return self.root.fastest(number)
        with self._lock:
            if number not in self._fastest:
                self._fastest[number] = self._fastest_of(number)
            return self._fastest[number]

    def spell(self, number: int) -> SpellInWindows:
        """Return a spell, in ticks as short as its fastest cells but one in a thousand need."""
        minutes = self.spells[number].minutes
        ticks = ticks_of(minutes, self.fastest(number)[0] * self.swiftest, self.cell_size)
        return SpellInWindows(lambda window: self.planes(number, window)[:, :_HEAD], minutes / ticks, ticks)

    def hour(self, number: int) -> Hour:
        """Return a spell on the whole map, its travel times float32 [G, 3, H, W]."""
        spell = self.spell(number)
        return Hour(spell.travel(Window.whole(self.size)), spell.minutes, spell.ticks)

    def of(self, fires: slice, each: int = 1) -> "Fires":
        """Return some of the fires, in the ticks of all.

        Args:
            fires: Whole groups, or fires of one law.
            each: Fires of each law.
        """
        laws = self.laws if not self.beside else self.laws[fires.start // each : -(-fires.stop // each)]
        rate = None if self.rate is None else self.rate[fires]
        spells = [spell.of(fires) for spell in self.spells]
        if self.groups == 1 and rate is None:
            return self
        swiftest = self.swiftest if self.swift is None else float(self.swift[fires.start])
        return replace(
            self, fire=laws[0], beside=laws[1:], spells=spells, rate=rate, swiftest=swiftest, root=self.root or self
        )

    def burn(self, lit: Tensor, key: Tensor, most: int | None = None) -> Burned:
        """Burn some fires at once, to the end of the weather.

        Args:
            lit: The cells that burn at minute 0, bool [H, W], or of each fire [b, H, W].
            key: Keys of the fires' draws of rates, int64 [b].
            most: Cells that each burns before it stops; None for no limit.

        Raises:
            ValueError: If their window does not fit in memory.
        """
        land = Land(lambda window: window.cut(self.fuel, False), lambda window: self.pace(key, window))
        embers: Embers | None = None
        if self.embers is not None:
            embers = SpotFires(self.embers, self._ember_ground(), key)
        about = lit
        if self.later is not None:
            later = torch.where(self.fuel, self.later, torch.inf)
            embers = LaterFires(later, len(key), embers)
            about = lit if bool(lit.any()) else later.isfinite()
        fits = partial(check_memory, fires=len(key), groups=self.groups, workers=self.workers)
        fires = GrowingFires(lit, len(key), land, most, fits, about)
        fires.burn_spells((self._going(number) for number in range(len(self.spells))), embers)
        return Burned(fires.window, fires.arrival(), self.pace(key, fires.window), self)

    def in_parts(self, lit: Tensor, key: Tensor, then: Callable[[Burned], T], most: int | None = None) -> Iterator[T]:
        """Burn many fires, some at a time, and yield the result of each part, in order.

        Args:
            lit: The cells that burn at minute 0, bool [H, W], or of each fire [B, H, W].
            key: Keys of the fires, int64 [B].
            then: Called with each part in a worker thread; its results are yielded.
            most: See ``burn``.

        Raises:
            ValueError: If the window of one fire does not fit in memory.
        """
        each = max(1, len(key) // len(self.laws))
        division = Division(each=each if self.beside else None, swift=self.swift)

        def burned(part: slice) -> T:
            return then(self.of(part, each).burn(lit if lit.dim() == 2 else lit[part], key[part], most))

        self._ended.clear()
        yield from division.each_part(burned, len(key), AT_ONCE, 1 if lit.is_cuda else self.workers, self._ended)

    def pace(self, key: Tensor, window: Window) -> Tensor:
        """Return the factor on the times of some fires in a window, float32 [b, h, w]."""
        pace = drawn_paces(self.laws, key, window)
        pace = pace if self.rate is None else pace / rates_in(self.rate, self.sector, window)
        return pace if self.half_way is None else torch.where(window.cut(self.half_way, False), 0.5 * pace, pace)

    def _ember_ground(self) -> EmberGround:
        """Return what firebrands fly over, by the first law."""
        return EmberGround(
            fuel=self.fuel,
            heads=lambda number, window: self.planes(number, window)[:, _HEAD:],
            air=lambda number, window: air_in(self.fire, self.landscape, self.spells[number], window, self.cell_size),
            groups=self.groups,
            by_code=self.fire.bed.table is None,
            cell_size=self.cell_size,
        )

    def _going(self, number: int) -> SpellInWindows:
        if (self.root or self)._ended.is_set():
            raise Ended
        return self.spell(number)

    def _planes(self, number: int, window: Window) -> Tensor:
        """Return the planes of each group, float32 [G 7, h, w], or G 8."""
        place = None if window.is_whole else window
        made = []
        for law in self.laws:
            spread = spread_in(law, self.landscape, self.cell_size, self.spells[number], place)
            times = travel(spread.head, spread.direction, spread.length_to_breadth, self.cell_size)
            made.append(torch.cat((times, heads(spread, self.runs_in_crowns)), dim=1))
        return (made[0] if len(made) == 1 else torch.cat(made)).flatten(0, 1)

    def _fastest_of(self, number: int) -> tuple[float, float]:
        low, high = zip(*(self._fastest_by(law, number) for law in self.laws), strict=True)
        return max(low), max(high)

    def _fastest_by(self, law: RateFire, number: int) -> tuple[float, float]:
        spell, rows = self.spells[number].fastest or self.spells[number], self._rows
        if rows is not None:
            fuel, heads = rows.fuel, iter([(rows.head(law, spell, self.cell_size), rows.fuel)])
        elif self.groups == 1 and next(strips(self.size)).is_whole:
            fuel, heads = self.fuel, iter([(self.planes(number, Window.whole(self.size))[0, _HEAD], self.fuel)])
        else:
            fuel = self.fuel
            heads = heads_of_strips(law, self.landscape, self.cell_size, spell, fuel, self.workers)
        return fastest_heads(heads, int(fuel.sum()), fuel.numel())

    @cached_property
    def _rows(self) -> RowsOfMap | None:
        return RowsOfMap.of(self.landscape, self.fuel, self.cell_size)
