"""Sums over many fires on one map, some fires at a time."""

from dataclasses import dataclass
from itertools import accumulate

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.prediction.counts import LATE, TIME_STEPS, Count
from warp_torchrl.system import memory
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.window import Window

_BLOCK = 2**24  # times that are sorted at once


@dataclass(frozen=True, eq=False)
class ArrivalQuantiles:
    """When fires reached each cell, over the fires that did; float32 [h, w] [minutes], NaN where none did."""

    median: Tensor
    early: Tensor  # a tenth of the fires came before
    late: Tensor  # and a tenth after
    half: Tensor  # when half of all fires had come; NaN where they never had


class Tally:
    """Sums of the counts of fires; of single fires it keeps only the arrival times, in 16 bits.

    Args:
        fires: How many there will be.
        minutes: How long fires are followed.
        order: The number of each fire, in the order in which they are added, int64 [B]; None: 0, 1, 2 ... The fire of
            number 0 must be the first of its part.
    """

    def __init__(self, fires: int, minutes: float, order: Tensor | None = None) -> None:
        self._fires, self._minutes = fires, minutes
        self._place = torch.arange(fires) if order is None else order.argsort()  # of each fire, as they are added
        self._counts: list[Count] = []
        self._window: Window | None = None
        self._came, self._sums = torch.zeros(0, 0), torch.zeros(0, 0, 0)

    def add(self, count: Count) -> None:
        """Add the counts of some fires.

        Raises:
            ValueError: If the times of all fires do not fit in memory.
        """
        self.check(count.window)
        self._reach(count.window, len(count.sums))
        place = count.window.place_in(self.window)
        self._came[place] += count.came
        self._sums[(slice(None), *place)] += count.sums
        self._counts.append(count)

    @property
    def window(self) -> Window:
        """Return the window that has all fires."""
        if self._window is None:
            raise ValueError("fires must have been added, got none")
        return self._window

    @property
    def at_once(self) -> int:
        """Return the most fires of one part."""
        return max(len(count.left) for count in self._counts)

    @property
    def first(self) -> Tensor:
        """Return when the first fire came, float32 [h, w] [minutes]; NaN where it did not."""
        plane = torch.full(self._came.shape, torch.nan)
        begins = [0, *accumulate(len(count.left) for count in self._counts)]
        count = self._counts[begins.index(int(self._place[0]))]
        plane[count.window.place_in(self.window)] = torch.where(count.first < NEVER / 2, count.first, torch.nan)
        return plane

    def joined(self, name: str) -> Tensor:
        """Return ``area`` [B, T] and ``final`` area [B] [ha], ``progress`` [B, T] [m], ``left`` or ``followed`` [B]."""
        return torch.cat([getattr(count, name) for count in self._counts])[self._place]

    def burn_probability(self) -> Tensor:
        """Return the share of the fires that reached each cell, float32 [h, w]."""
        return self._came / sum(len(count.left) for count in self._counts)

    def means(self) -> list[Tensor]:
        """Return the means of ``Count.sums`` over the fires that came, float32 [h, w] each, NaN for none."""
        return [torch.where(self._came > 0.0, part / self._came, torch.nan) for part in self._sums]

    def every(self) -> Tensor:
        """Return when each fire came, float32 [B, h, w] [minutes]; NaN where it did not."""
        block = slice(0, self.window.height), slice(0, self.window.width)
        times = torch.cat([self._times(count, block) for count in self._counts])
        times = times[self._place]
        minutes = (times.to(torch.float32) + TIME_STEPS // 2) * (self._minutes / TIME_STEPS)
        return torch.where(times < LATE, minutes, torch.nan)

    def arrivals(self) -> ArrivalQuantiles:
        """Return quantiles of the arrival times, to a 65,534th of the time that fires are followed."""
        found = torch.full((4, *self._came.shape), torch.nan)
        at_once = max(1, _BLOCK // sum(len(count.times) for count in self._counts))  # cells
        rows, columns = max(1, at_once // self.window.width), min(at_once, self.window.width)
        for top in range(0, self.window.height, rows):
            for left in range(0, self.window.width, columns):
                block = slice(top, top + rows), slice(left, left + columns)
                if bool(self._came[block].any()):
                    times = torch.cat([self._times(count, block) for count in self._counts])
                    quantiles = self._quantiles(times.flatten(1).sort(dim=0).values)
                    found[(slice(None), *block)] = quantiles.view(4, *times.shape[1:])
        return ArrivalQuantiles(*found)

    def check(self, window: Window) -> None:
        """Refuse fires whose times would not fit in memory if all that are left had this window.

        Raises:
            ValueError: With how many they are, the window and what they want.
        """
        left = self._fires - sum(len(each.times) for each in self._counts)
        wanted, there = 2.0 * left * window.cells, memory.available()
        if wanted > there:
            size = f"{window.height} x {window.width}"
            raise memory.too_little(f"the arrival times of {left} fires in {size} cells", wanted, there)

    def _reach(self, window: Window, n_sums: int) -> None:
        """Make room for a window of some sums."""
        if self._window is None:
            self._window = window
            self._came, self._sums = (torch.zeros(*n, window.height, window.width) for n in ((), (n_sums,)))
            return
        before, self._window = self._window, self._window.joined(window)
        if self._window != before:
            rows, columns = before.place_in(self._window)
            sides = (
                columns.start,
                self._window.width - columns.stop,
                rows.start,
                self._window.height - rows.stop,
            )
            self._came, self._sums = pad(self._came, sides), pad(self._sums, sides)

    def _times(self, count: Count, block: tuple[slice, slice]) -> Tensor:
        """Return the times of some fires in a block of the window, int16 [b, rows, columns]."""
        shape = self._came[block].shape
        found = torch.full((len(count.times), *shape), LATE, dtype=torch.int16)
        place = count.window.place_in(self.window)
        spans = [
            (max(mine.start, its.start), min(mine.start + length, its.stop))
            for mine, its, length in zip(block, place, shape, strict=True)
        ]
        if all(first < last for first, last in spans):
            here = [slice(first - mine.start, last - mine.start) for (first, last), mine in zip(spans, block)]
            there = [slice(first - its.start, last - its.start) for (first, last), its in zip(spans, place)]
            found[:, here[0], here[1]] = count.times[:, there[0], there[1]]
        return found

    def _quantiles(self, times: Tensor) -> Tensor:
        """Return median, early, late and half of sorted times [B, n], float32 [4, n]."""
        count = (times < LATE).sum(0)
        found = [_between(times, (count - 1).clamp(min=0) * share) for share in (0.5, 0.1, 0.9)]
        half = times[(len(times) - 1) // 2]
        minutes = (torch.stack([*found, half.to(torch.float32)]) + TIME_STEPS // 2) * (self._minutes / TIME_STEPS)
        return torch.where(torch.stack([count > 0] * 3 + [half < LATE]), minutes, torch.nan)


def _between(times: Tensor, place: Tensor) -> Tensor:
    """Return sorted values [B, n] at fractional places [n], by linear interpolation, float32 [n]."""
    below = place.floor().to(torch.int64)
    low, high = (
        times.gather(0, each[None])[0].to(torch.float32) for each in (below, (below + 1).clamp(max=len(times) - 1))
    )
    part = place - below
    return torch.where(part > 0.0, low + part * (high - low), low)
