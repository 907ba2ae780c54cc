"""Fires without vehicles under law ``rate``: many on one map, in hourly weather, from ignition to an end."""

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TypeVar

import torch
from torch import Tensor

from warp_torchrl.system import memory
from warp_torchrl.world.backends.growing import GrowingFires, Land, SpellInWindows
from warp_torchrl.world.backends.spells import Highest, PlanesOfSpells, in_window, on_strips
from warp_torchrl.world.fires.spell import BUT_FASTEST, Spell, can_ignite, heads, spread_in, ticks_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER, travel
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

_AT_ONCE = 64  # fires, whose planes a CPU's cache holds
_MOST_CELLS = 2**24  # of the windows of fires that burn at once
_BYTES_A_FIRE, _BYTES_A_CELL = 64, 200  # that a cell of a window takes at most, for each fire and for the map
_PLANES = ("head", "backing", "intensity", "flame_length")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Burned:
    """Cells burned by some fires, in a window of the map."""

    window: Window
    minutes: Tensor  # when each fire reached each cell, float32 [b, h, w]; ``travel.NEVER`` where it does not come
    pace: Tensor  # factor on its times, float32 [b, h, w]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fires:
    """Fires without vehicles on one map, in weather by the spell. Everything is computed on demand.

    In each spell, ticks are as short as its fastest cells need; ``fire.minutes_per_tick`` is not read.

    Attributes:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        spells: The weather.
        cell_size: Side of a cell [m].
        workers: Threads.
    """

    fire: RateFire
    landscape: Landscape
    spells: Sequence[Spell]
    cell_size: float
    workers: int = field(default_factory=torch.get_num_threads)
    _lock: threading.Lock = field(init=False, repr=False, default_factory=threading.Lock)
    _fastest: dict[int, tuple[float, float]] = field(init=False, repr=False, default_factory=dict)
    _ended: threading.Event = field(init=False, repr=False, default_factory=threading.Event)

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

    @cached_property
    def planes(self) -> PlanesOfSpells:
        """Return the function of a spell and a window that gives travel times and then ``Heads``, float32 [7, h, w]."""
        return PlanesOfSpells(lambda number, window: in_window(partial(self._planes, number), window))

    def fastest(self, number: int) -> tuple[float, float]:
        """Return the rates of a spell's fastest heads but one in a thousand [m/min].

        Of the cells that can ignite, and of all cells.
        """
        with self._lock:
            if number not in self._fastest:
                self._fastest[number] = self._fastest_of(number)
            return self._fastest[number]

    def spell(self, number: int) -> SpellInWindows:
        """Return a spell, in ticks as short as its fastest cells but one in a thousand need."""
        minutes = self.spells[number].minutes
        ticks = ticks_of(minutes, self.fastest(number)[0], self.cell_size)
        return SpellInWindows(lambda window: self.planes(number, window)[:3], minutes / ticks, ticks)

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
        fires = GrowingFires(lit, len(key), land, most, partial(self._check, len(key)))
        fires.burn_spells(self._going(number) for number in range(len(self.spells)))
        return Burned(fires.window, fires.arrival(), self.pace(key, fires.window))

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
        limit = [_AT_ONCE]

        def burned(part: tuple[Tensor, Tensor]) -> list[T]:
            keys, begun = part
            try:
                if len(keys) > limit[0]:
                    raise _TooMany
                return [then(self.burn(begun, keys, most))]
            except _TooMany:
                half = limit[0] = min(limit[0], -(-len(keys) // 2))
                return [each for less in _parts(keys, begun, half) for each in burned(less)]

        self._ended.clear()
        workers = 1 if lit.is_cuda else self.workers
        for found in _side_by_side(burned, _parts(key, lit, _AT_ONCE), workers, self._ended):
            yield from found

    def pace(self, key: Tensor, window: Window) -> Tensor:
        """Return the factor on the times of some fires in a window, float32 [b, h, w]."""
        return self.fire.pace(key, self.size) if window.is_whole else self.fire.pace_in(key, window)

    def _going(self, number: int) -> SpellInWindows:
        if self._ended.is_set():
            raise _Ended
        return self.spell(number)

    def _check(self, fires: int, window: Window) -> None:
        """Refuse a window that is too large for ``fires`` fires at once.

        Raises:
            _TooMany: If fewer fires may fit.
            ValueError: If not even one fits.
        """
        wanted = window.cells * (fires * _BYTES_A_FIRE + _BYTES_A_CELL)
        there = memory.available()
        if fires > 1 and (fires * window.cells > _MOST_CELLS or wanted * self.workers > there):
            raise _TooMany
        if wanted > there:
            raise memory.too_little(f"a fire in a window of {window.height} x {window.width} cells", wanted, there)

    def _planes(self, number: int, window: Window) -> Tensor:
        place = None if window.is_whole else window
        spread = spread_in(self.fire, self.landscape, self.cell_size, self.spells[number], place)
        made = travel(spread.head, spread.direction, spread.length_to_breadth, self.cell_size)
        return torch.cat((made[0], heads(spread)))

    def _head(self, number: int, strip: Window) -> Tensor:
        if strip.is_whole:
            return self.planes(number, strip)[3]
        return spread_in(self.fire, self.landscape, self.cell_size, self.spells[number], strip).head[0]

    def _fastest_of(self, number: int) -> tuple[float, float]:
        n_fuel, n_cells = int(self.fuel.sum()), self.fuel.numel()
        of_fuel = Highest(n_fuel - max(1, math.ceil(BUT_FASTEST * n_fuel)) + 1)
        of_all = Highest(n_cells - max(1, round(BUT_FASTEST * n_cells)) + 1)
        for strip, head in on_strips(partial(self._head, number), self.size, self.workers):
            of_fuel.add(head[strip.cut(self.fuel, False)])
            of_all.add(head.flatten())
        return of_fuel.least if n_fuel else 0.0, of_all.least


def arrival_minutes(
    fire: RateFire,
    landscape: Landscape,
    lit: Tensor,
    key: Tensor,
    spells: Sequence[Spell],
    cell_size: float,
) -> Iterator[Tensor]:
    """Return when each fire reaches each cell, some fires at a time.

    Args:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        lit: The cells that burn at minute 0, bool [H, W], or of each fire [B, H, W].
        key: Of the fires, int64 [B]: their draws of rates.
        spells: The weather.
        cell_size: Side of a cell [m].

    Yields:
        float32 [b, H, W] [minutes], in order; ``travel.NEVER`` where the fire does not come.
    """
    fires = Fires(fire=fire, landscape=landscape, spells=spells, cell_size=cell_size)
    yield from fires.in_parts(lit, key, _on_map)


def _on_map(burned: Burned) -> Tensor:
    """Return the minutes on the whole map."""
    if burned.window.is_whole:
        return burned.minutes.clone()
    plane = burned.minutes.new_full((len(burned.minutes), *burned.window.map), NEVER)
    return burned.window.put(burned.minutes, plane)


class _TooMany(Exception):  # noqa: N818
    """Too many fires to burn at once in their window."""


class _Ended(Exception):  # noqa: N818
    """Other threads have ended the work."""


def _parts(key: Tensor, lit: Tensor, size: int) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield the keys of ``size`` fires at a time, and where they start, bool [H, W] or [b, H, W]."""
    parts = key.split(size)
    yield from zip(parts, lit.split(size) if lit.dim() == 3 else [lit] * len(parts), strict=True)


def _side_by_side(
    function: Callable[[tuple[Tensor, Tensor]], T],
    parts: Iterable[tuple[Tensor, Tensor]],
    workers: int,
    ended: threading.Event,
) -> Iterator[T]:
    """Yield a function of each part, in order, computed by ``workers`` threads; an event ends it early.

    Few operations of a fire are large enough for torch's own threads, so each fire takes one thread.
    """
    if workers == 1:
        yield from map(function, parts)
        return
    waiting: deque[Future[T]] = deque()
    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        try:
            for part in parts:
                waiting.append(pool.submit(function, part))
                if len(waiting) > workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            ended.set()  # after an error, an interruption, or who asked has had enough
            pool.shutdown(wait=False, cancel_futures=True)
