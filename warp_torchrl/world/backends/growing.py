"""Fires in a growing window of the map, bit for bit as on the whole map.

What burns stays off the window's outermost cells but at the map's own sides. So all cells that a fire can reach in a
tick, and all that their times follow from, lie in the window.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.backends.spreading import Spreading, chosen
from warp_torchrl.world.law.passing import steepness_from
from warp_torchrl.world.law.travel import NEVER, NOWHERE
from warp_torchrl.world.state.window import Window

_LISTS = ("fire", "cell", "minutes", "steep", "pace")


@dataclass(frozen=True, eq=False)
class SpellInWindows:
    """A time of one weather, of which any window can be asked."""

    travel: Callable[[Window], Tensor]  # float32 [3, h, w]; see ``travel.travel`` [minutes a cell]
    minutes: float  # of a tick
    ticks: int


@dataclass(frozen=True, eq=False)
class Land:
    """What does not change with the weather, of which any window can be asked; nothing can ignite past the map."""

    fuel: Callable[[Window], Tensor]  # cells that can ignite, bool [h, w]
    pace: Callable[[Window], Tensor]  # factor on the times of each fire, float32 [B, h, w]


@dataclass(frozen=True, eq=False)
class Caught:
    """Cells of some fires that caught fire in a tick; tensors are [n], of which the first ``count`` are different."""

    window: Window
    fire: Tensor  # index of the fire, int64
    cell: Tensor  # flat index in the map, int64
    minutes: Tensor  # when the fire came, float32
    steep: Tensor  # |grad T| then, float32 [minutes a cell]; see ``passing.steepness_from``
    pace: Tensor  # factor on the fire's times there, float32
    count: int

    def filled(self, length: int) -> "Caught":
        """Return them with the first one repeated until their number is a multiple of a length."""
        more = -self.count % length if self.count else 0

        def longer(values: Tensor) -> Tensor:
            return torch.cat((values, values[:1].expand(more)))

        return self._each(longer, self.count)

    def some(self, which: Tensor) -> "Caught":
        """Return some of those that are different, by their places, int64 [k]."""
        return self._each(lambda values: values.index_select(0, which), len(which))

    @classmethod
    def joined(cls, parts: Sequence["Caught"]) -> "Caught":
        """Return those of some ticks in one window, each of which are all different."""
        lists: dict[str, Any] = {name: torch.cat([getattr(each, name) for each in parts]) for name in _LISTS}
        return cls(window=parts[0].window, count=sum(each.count for each in parts), **lists)

    def _each(self, change: Callable[[Tensor], Tensor], count: int) -> "Caught":
        changed: dict[str, Any] = {name: change(getattr(self, name)) for name in _LISTS}
        return replace(self, count=count, **changed)


class Embers(Protocol):
    """What starts fires ahead of others."""

    @property
    def smoulder(self) -> bool:
        """Return whether any fire is still to start."""
        ...

    def due(self, end: float) -> tuple[Tensor, Tensor, Tensor]:
        """Return what starts until a time [minutes]: of which fire, in which cell of the map, and when, [n] each."""
        ...

    def thrown(self, number: int, caught: Caught) -> None:
        """Take the cells that caught fire in a tick of a spell of this number."""
        ...


class GrowingFires(Spreading):
    """Fires on one map, in one window.

    Args:
        lit: The cells that burn at minute 0, bool [H, W], or of each fire [B, H, W].
        fires: How many, B.
        land: The map.
        most: Cells that each fire burns before it stops; None lets it go on.
        check: Is told each new window before anything is made for it, and may refuse it by an exception.
        about: The cells about which the first window lies, bool [H, W], one at least; None: those that are lit.
    """

    def __init__(
        self,
        lit: Tensor,
        fires: int,
        land: Land,
        most: int | None = None,
        check: Callable[[Window], None] = lambda window: None,
        about: Tensor | None = None,
    ) -> None:
        self.window = Window.about(lit if about is None else about)
        self._land, self._most, self._check = land, most, check
        check(self.window)
        self._rim: tuple[Tensor, ...] | None = None
        first = self.window.cut(lit, False).expand(fires, self.window.height, self.window.width)
        super().__init__(first, land.fuel(self.window), land.pace(self.window))
        self._count = self._burned.view(fires, -1).sum(1)
        self._going = torch.ones(fires, dtype=torch.bool, device=lit.device)
        self._measure_rim()
        self._spotted = self._lit[:0]

    @property
    def is_over(self) -> bool:
        """Return whether nothing can burn any more."""
        return not len(self._waiting)

    def burn_spells(self, spells: Iterable[SpellInWindows], embers: Embers | None = None) -> None:
        """Advance by some spells, one after the other, as long as anything can burn; later ones are not asked for."""
        before: Tensor | None = None
        for number, spell in enumerate(spells):
            travel = self._planes(spell.travel(self.window))
            if before is not None:
                self._change(before, travel)
            began = self._now
            for tick in range(1, spell.ticks + 1):
                end, window = began + tick * spell.minutes, self.window
                if self._is_cramped():
                    self._grow()
                if embers is not None:
                    self._light(*embers.due(end))
                if self.window != window:
                    travel = self._planes(spell.travel(self.window))
                self._tick(travel, end)
                if embers is not None:
                    self._lit = torch.cat((self._lit, self._spotted))
                    embers.thrown(number, self._caught())
                if self._most is not None:
                    self._stop_at(self._most)
                if self.is_over and not (embers is not None and embers.smoulder):
                    return
            before = travel

    def _light(self, fire: Tensor, cell: Tensor, minutes: Tensor) -> None:
        """Light cells of the map, int64 [n], at some minutes where the fire has not come before; see ``Embers.due``."""
        self._spotted = self._lit[:0]
        if self._most is not None:
            fire, cell, minutes = chosen(self._going[fire], fire, cell, minutes)
        if not len(fire):
            return
        row, column = cell // self.window.map[1], cell % self.window.map[1]
        self._move(self.window.with_cells(row, column))
        place = (row - self.window.top + 1) * self._width + column - self.window.left + 1
        lit = fire * self._map + place
        new = (self._free.index_select(0, lit) | self._beside.index_select(0, lit)) & (minutes < self._times[lit])
        lit, minutes = chosen(new, lit, minutes)
        if not len(lit):
            return
        self._times.scatter_reduce_(0, lit, minutes, "amin")
        lit = self._once(lit)
        self._burned[lit], self._beside[lit], self._free[lit], self._near[lit] = True, False, False, NEVER
        self.minutes[lit] = self._times[lit]
        self._origins[lit] = self._place(lit)
        self._waiting, self._joined = (
            chosen(self._beside.index_select(0, each), each)[0] for each in (self._waiting, self._joined)
        )
        self._changed = torch.cat((self._changed, lit))
        self._join(lit)
        self._spotted = lit

    def _caught(self) -> Caught:
        """Return the cells that caught fire in the last tick."""
        lit, place = self._lit, self._place(self._lit).long()
        around = self.minutes[(self._offsets[:, None] + lit).flatten()].view(8, -1)
        row, column = place // self._width - 1 + self.window.top, place % self._width - 1 + self.window.left
        return Caught(
            window=self.window,
            fire=lit // self._map,
            cell=row * self.window.map[1] + column,
            minutes=self.minutes[lit],
            steep=steepness_from(around, self.minutes[lit]),
            pace=self._pace[lit],
            count=len(lit),
        )

    def _is_cramped(self) -> bool:
        """Return whether the fire may come to the outermost cells in the next tick."""
        if self._rim is None or not len(self._waiting):
            return False
        return bool(self._rim_any[self._place(self._waiting).long()].any())

    def _measure_rim(self) -> None:
        """Find the outermost cells of the window, in planes with their margin."""
        if self.window.is_whole:
            self._rim = None
            return
        self._rim = tuple(pad(side, (1, 1, 1, 1)).flatten() for side in self.window.rim())
        self._rim_any = torch.stack(self._rim).any(0)

    def _grow(self) -> None:
        """Go on in a window that is twice as long to the sides that the fire nears."""
        near = self._place(self._waiting).long()
        self._move(self.window.grown(*(bool(side[near].any()) for side in self._rim or ())))

    def _move(self, after: Window) -> None:
        """Go on in another window, which has this one."""
        before = self.window
        if after == before:
            return
        self._check(after)
        rows, columns = before.on_map.place_in(after)
        width, cells = after.width + 2, (after.height + 2) * (after.width + 2)
        worlds, old_map, old_width = self.shape[0], self._map, self._width

        def moved(place: Tensor) -> Tensor:
            return (place // old_width + rows.start) * width + place % old_width + columns.start

        def relaid(plane: Tensor, beyond: float | Tensor) -> Tensor:
            grown = torch.zeros((worlds, after.height + 2, width), dtype=plane.dtype, device=plane.device)
            if isinstance(beyond, Tensor):
                grown[:, 1:-1, 1:-1] = beyond
            else:
                grown.fill_(beyond)
            inside = plane.view(self.shape)[:, 1:-1, 1 : 1 + before.on_map.width]
            grown[:, 1 + rows.start : 1 + rows.stop, 1 + columns.start : 1 + columns.stop] = inside
            return grown.flatten()

        def listed(of: Tensor) -> Tensor:
            return of // old_map * cells + moved(of % old_map)

        self._times, self.minutes = relaid(self._times, NEVER), relaid(self.minutes, NEVER)
        self._burned, self._beside = relaid(self._burned, False), relaid(self._beside, False)
        self._near, self._free = relaid(self._near, NEVER), relaid(self._free, self._land.fuel(after))
        self._origins = relaid(torch.where(self._origins < 0, NOWHERE, moved(self._origins)), NOWHERE)
        self._waiting, self._changed, self._joined = (
            listed(each) for each in (self._waiting, self._changed, self._joined)
        )
        self._lay_out((worlds, after.height, after.width), self._land.pace(after))
        self.window = after
        self._measure_rim()

    def _stop_at(self, most: int) -> None:
        """Stop fires that have burned so many cells, once none that may still change comes before the last of them."""
        fires = torch.arange(self.shape[0], device=self._burned.device)
        self._count += torch.bincount(self._lit // self._map, minlength=len(fires))
        for fire in fires[self._going & (self._count >= most)].tolist():
            times = self.minutes[fire * self._map : (fire + 1) * self._map]
            last = times[self._burned[fire * self._map : (fire + 1) * self._map]].kthvalue(most).values
            ahead = torch.cat((self._waiting, self._changed))
            ahead = self._times[ahead[ahead // self._map == fire]]
            if not bool((ahead <= last).any()):
                self._going[fire] = False
        self._waiting = self._waiting[self._going[self._waiting // self._map]]
        self._changed = self._changed[self._going[self._changed // self._map]]
        self._joined = self._joined[self._going[self._joined // self._map]]
