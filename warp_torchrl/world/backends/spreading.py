"""Fires with rates of spread from their start on, at the cells alone whose time may still change.

Without a team nothing but the fire changes a cell, so what a cell's neighbours told it holds until one of them tells
another. The times are those that ``RateFire.tick`` comes to, tick by tick, to the bit.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.law.travel import (
    NEVER,
    NOWHERE,
    Metric,
    Places,
    arrival,
    differ,
    kindling,
    least_ratio,
    since,
    until,
)


@dataclass(frozen=True, eq=False)
class Hour:
    """A time of one weather."""

    travel: Tensor  # float32 [3, H, W], or [G, 3, H, W] of G groups of worlds; see ``travel.travel`` [minutes a cell]
    minutes: float  # of a tick
    ticks: int


class Spreading:
    """Fires on one map. Planes have a margin of one cell about the map, so that every cell has eight neighbours.

    Args:
        lit: The cells that burn at minute 0, bool [B, H, W].
        fuel: The cells that can ignite, bool [H, W].
        pace: Factor on the times, float32 [B, H, W].
    """

    def __init__(self, lit: Tensor, fuel: Tensor, pace: Tensor) -> None:
        burned = pad(lit, (1, 1, 1, 1)).flatten()
        self._burned = burned
        self._times = torch.where(burned, 0.0, NEVER)
        self._origins = torch.full_like(self._times, NOWHERE, dtype=torch.int32)
        self.minutes = self._times.clone()
        self._near = torch.full_like(self._times, NEVER)  # when a cell that waits kindles its neighbours
        self._beside = torch.zeros_like(burned)  # waits
        self._free = pad(fuel.expand_as(lit), (1, 1, 1, 1)).flatten() & ~burned  # can ignite, and does not wait yet
        self._lay_out((lit.shape[0], lit.shape[1], lit.shape[2]), pace)
        started = burned.nonzero()[:, 0]
        self._origins[started] = self._place(started)
        self._waiting = self._changed = self._joined = self._lit = started[:0]
        self._join(started)
        self._now = 0.0

    def _lay_out(self, size: tuple[int, int, int], pace: Tensor) -> None:
        """Make what hangs on the size of the map alone (B, H, W)."""
        worlds, height, width = size
        self.shape = (worlds, height + 2, width + 2)
        self._map = (height + 2) * (width + 2)
        self._width = width + 2
        self._pace = pad(pace, (1, 1, 1, 1), value=1.0).flatten()
        self._slot = torch.zeros_like(self._origins)
        self._offsets = torch.tensor([row * self._width + column for row, column in DIRECTIONS], device=pace.device)

    def arrival(self) -> Tensor:
        """Return when the fire reached each cell, float32 [B, H, W] [minutes]; ``NEVER`` where it has not."""
        return self.minutes.view(self.shape)[:, 1:-1, 1:-1]

    def burn(self, hours: Iterable[Hour]) -> None:
        """Advance by some hours, one after the other."""
        before: Tensor | None = None
        for hour in hours:
            travel = self._planes(hour.travel)
            if before is not None:
                self._change(before, travel)
            before, began = travel, self._now
            for tick in range(1, hour.ticks + 1):
                self._tick(travel, began + tick * hour.minutes)

    def _planes(self, travel: Tensor) -> Tensor:
        """Return times of ways with a margin, float32 [3, ...]."""
        return pad(travel, (1, 1, 1, 1), value=NEVER).view(-1, 3, self._map).transpose(0, 1).flatten(1)

    def _tick(self, travel: Tensor, end: float) -> None:
        cells = self._once(torch.cat((self._around(self._changed), self._joined)))
        metric = self._metric(travel, cells)
        times, origins = self._coming(metric, cells, earliest=2.0 * self._now - end)
        differ = (times != self._times.index_select(0, cells)) | (origins != self._origins.index_select(0, cells))
        changed, times, origins, slowness = chosen(differ, cells, times, origins, metric[0])
        self._times[changed], self._origins[changed] = times, origins
        self._near[changed] = kindling(times, slowness)
        reached = self._times.index_select(0, self._waiting) <= end
        (lit,) = chosen(reached, self._waiting)
        if len(lit):
            (self._waiting,) = chosen(~reached, self._waiting)
        self._burned[lit], self._beside[lit] = True, False
        self.minutes[lit] = self._times[lit]
        self._lit, self._changed, self._joined = lit, changed, lit[:0]
        self._join(lit)
        self._now = end
        self._kindle()

    def _kindle(self) -> None:
        """Let the neighbours of cells that are about to burn join those that wait."""
        (near,) = chosen(self._near.index_select(0, self._waiting) <= self._now, self._waiting)
        self._near[near] = NEVER
        self._join(near)

    def _join(self, cells: Tensor) -> None:
        """Let the neighbours of cells join those that wait."""
        around = (cells + self._offsets[:, None]).flatten()
        around = self._once(*chosen(self._free.index_select(0, around), around))
        self._free[around], self._beside[around] = False, True
        self._waiting = torch.cat((self._waiting, around))
        self._joined = torch.cat((self._joined, around))

    def _around(self, cells: Tensor) -> Tensor:
        """Return the waiting neighbours of cells, some more than once."""
        around = (cells + self._offsets[:, None]).flatten()
        return chosen(self._beside.index_select(0, around), around)[0]

    def _once(self, cells: Tensor) -> Tensor:
        number = torch.arange(len(cells), dtype=torch.int32, device=cells.device)
        self._slot[cells] = number
        return chosen(self._slot.index_select(0, cells) == number, cells)[0]

    def _coming(self, metric: Metric, cells: Tensor, earliest: float) -> tuple[Tensor, Tensor]:
        around = (self._offsets[:, None] + cells).flatten()
        times = self._times.index_select(0, around).view(8, -1)
        origins = self._origins.index_select(0, around).view(8, -1)
        place = self._place(cells)
        first = cells - place

        def time_of(origin: Tensor) -> Tensor:
            return self.minutes_now.index_select(0, first + origin)

        at = Places(place // self._width, place % self._width, self._width, time_of)
        times, origins = arrival(times, origins, metric, at)
        times = times.clamp(min=earliest)
        kept = self._times.index_select(0, cells)
        holds = (self._origins.index_select(0, cells) == place) & (kept <= times)
        return torch.where(holds, kept, times), torch.where(holds, place, origins)

    @property
    def minutes_now(self) -> Tensor:
        """Return the times in force of the cells that have burned; those of others are not asked for."""
        return self._times

    def _metric(self, travel: Tensor, cells: Tensor) -> Metric:
        pace, place = self._pace.index_select(0, cells), self._on_travel(travel, cells)
        slowness, east, north = (part.index_select(0, place) * pace for part in travel)
        return slowness, east, north

    def _on_travel(self, travel: Tensor, cells: Tensor) -> Tensor:
        """Return the flat index of cells in planes of travel, int64 [n]."""
        place = self._place(cells).long()
        if travel.shape[1] > self._map:
            place = place + cells // (len(self._pace) // (travel.shape[1] // self._map)) * self._map
        return place

    def _place(self, cells: Tensor) -> Tensor:
        return (cells % self._map).to(torch.int32)

    def _change(self, before: Tensor, after: Tensor) -> None:
        """Go on in another weather, as ``RateFire.in_air`` does."""
        waiting = self._waiting
        waiting = waiting[differ(self._metric(before, waiting), self._metric(after, waiting))]
        around = waiting + self._offsets[:, None]
        burned = self._burned[around]
        edge = self._once(around[burned])
        begun = since(self._times[edge], self._now, self._least_ratio(before, after, edge))
        ahead = self._times[waiting] > self._now
        waiting, around, beside = waiting[ahead], around[:, ahead], burned[:, ahead].any(0)
        old, new = self._metric(before, waiting), self._metric(after, waiting)
        comes = until(self._times[waiting], self._now, self._times[around], old, new)
        comes = torch.where(beside, comes, NEVER)
        self._times[edge], self._origins[edge] = begun, self._place(edge)
        self._times[waiting], self._near[waiting] = comes, kindling(comes, new[0])
        self._origins[waiting] = torch.where(comes < NEVER, self._place(waiting), NOWHERE)
        self._beside[waiting], self._free[waiting] = beside, ~beside
        self._waiting, self._joined = (each[self._beside[each]] for each in (self._waiting, self._joined))
        self._changed = torch.cat((self._changed, edge, waiting))
        self._kindle()

    def _least_ratio(self, before: Tensor, after: Tensor, edge: Tensor) -> Tensor:
        """Return the least ratio of F into the neighbours of burned cells that can ignite, float32 [n]."""
        around = (edge + self._offsets[:, None]).flatten()
        one, other = self._metric(before, around), self._metric(after, around)
        changes = (self._beside[around] | self._free[around]) & differ(one, other)
        return torch.where(changes, least_ratio(one, other), 1.0).view(8, -1).amin(0)


def chosen(which: Tensor, *lists: Tensor) -> list[Tensor]:
    """Return the chosen numbers of some lists, [n] each; faster than to index each by truths, bool [n]."""
    place = which.nonzero()[:, 0]
    return [each.index_select(0, place) for each in lists]
