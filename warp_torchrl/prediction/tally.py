"""Sums over many fires on one map, some fires at a time."""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl import memory
from warp_torchrl.prediction.passing import Behaviour, passing, steepness_from
from warp_torchrl.world.alone import Burned, Fires
from warp_torchrl.world.fast.window import COLUMNS, Window
from warp_torchrl.world.geometry import DIRECTIONS
from warp_torchrl.world.travel import NEVER

_STEPS = 65534  # of a time in 16 bits, over the whole time
_LATE = 32767  # stands for a fire that does not come
_BLOCK = 2**24  # times that are sorted at once
_HECTARE = 10_000.0  # [m2]


@dataclass(frozen=True, eq=False)
class Arrivals:
    """When fires reached each cell, over the fires that did; float32 [h, w] [minutes], NaN where none did."""

    median: Tensor
    early: Tensor  # a tenth of the fires came before
    late: Tensor  # and a tenth after
    half: Tensor  # when half of all fires had come; NaN where they never had


@dataclass(frozen=True, kw_only=True, eq=False)
class Count:
    """What some fires did, counted in their window."""

    window: Window
    came: Tensor  # how many fires came, float32 [h, w]
    sums: Tensor  # over them of rate [m/min], intensity [kW/m] and flame length [m], float32 [3, h, w]
    times: Tensor  # when each fire came, int16 [b, h, w]
    area: Tensor  # burned by each hour, float32 [b, T] [ha]
    final: Tensor  # burned in the end, float32 [b] [ha]
    progress: Tensor  # the farthest from the start by each hour, float32 [b, T] [m]
    left: Tensor  # whether it came to the map's edge, bool [b]
    followed: Tensor  # for how long, float32 [b] [minutes]
    first: Tensor  # arrival of the first fire, float32 [h, w] [minutes]


@dataclass(frozen=True, kw_only=True, eq=False)
class Counter:
    """Counts fires that have burned.

    Attributes:
        fires: Of which map, in which weather.
        lit: Where they start, bool [H, W].
        minutes: How long fires are followed.
        area: Area at which they stop [ha]; None lets them go on.
    """

    fires: Fires
    lit: Tensor
    minutes: float
    area: float | None

    @cached_property
    def hours(self) -> Tensor:
        """Return the full hours in this time, float32 [T]: 0, 1, 2 ..."""
        return torch.arange(math.floor(self.minutes / 60.0 + 1e-6) + 1, dtype=torch.float32)

    @property
    def most_cells(self) -> int | None:
        """Return the cells of the area at which fires stop."""
        return None if self.area is None else math.ceil(self.area * _HECTARE / self.fires.cell_size**2 - 1e-6)

    @cached_property
    def middle(self) -> Tensor:
        """Return the middle of the cells that are lit, (row, column), float32 [2]."""
        return self.lit.nonzero().to(torch.float32).mean(0)

    @cached_property
    def _ends(self) -> Tensor:
        minutes = torch.tensor([spell.minutes for spell in self.fires.spells], dtype=torch.float64)
        return minutes.cumsum(0).to(torch.float32)

    def __call__(self, burned: Burned) -> Count:
        """Return the counts of some fires."""
        followed = self._followed(burned.minutes)
        arrival = torch.where(burned.minutes <= followed[:, None, None], burned.minutes, NEVER)
        came = arrival < NEVER / 2
        area, progress = self._by_hour(arrival, came, burned.window)
        inside = burned.window.on_map
        return Count(
            window=inside,
            came=came.sum(0).to(torch.float32)[:, : inside.width],
            sums=self._sums(arrival, burned)[:, :, : inside.width],
            times=self._in_steps(arrival, came)[:, :, : inside.width],
            area=area,
            final=came.sum((1, 2)) * (self.fires.cell_size**2 / _HECTARE),
            progress=progress,
            left=_left(came, burned.window),
            followed=followed,
            first=arrival[0, :, : inside.width].clone(),
        )

    def _followed(self, arrival: Tensor) -> Tensor:
        """Return for how long each fire is followed, float32 [b] [minutes]."""
        whole, most = torch.full((len(arrival),), self.minutes), self.most_cells
        if most is None or most > arrival[0].numel():
            return whole
        return torch.minimum(whole, arrival.flatten(1).kthvalue(max(1, most), dim=1).values)

    def _in_steps(self, arrival: Tensor, came: Tensor) -> Tensor:
        steps = (arrival * (_STEPS / self.minutes)).round() - _STEPS // 2
        return torch.where(came, steps, _LATE).to(torch.int16)

    def _sums(self, arrival: Tensor, burned: Burned) -> Tensor:
        """Return the sums of rate, intensity and flame length over the fires, float32 [3, h, w].

        Where a fire did not come, or was lit, it adds 0.
        """
        cells = ((arrival > 0.0) & (arrival < NEVER / 2)).flatten().nonzero()[:, 0]
        count, sums = len(cells), torch.zeros(3, *arrival.shape[1:])
        if not count:
            return sums
        cells = torch.cat((cells, cells[:1].expand(-count % COLUMNS)))  # vectors that are filled
        times = arrival.flatten()[cells]
        then = self._then(cells % burned.window.cells, times, burned.window)
        steep = steepness_from(_around(arrival, cells), times)
        for number, values in enumerate(passing(steep, burned.pace.flatten()[cells], then, self.fires.cell_size)):
            plane = torch.zeros(arrival.numel())
            plane[cells] = values
            sums[number] = plane.view(arrival.shape).sum(0)
        return sums

    def _then(self, place: Tensor, times: Tensor, window: Window) -> Behaviour:
        """Return what heads do in cells of a window at some times, float32 [n]."""
        spell = torch.bucketize(times, self._ends).clamp(max=len(self._ends) - 1)
        order = spell.argsort()
        found = torch.empty(4, len(place))
        for part in order.split(torch.bincount(spell).tolist()):
            if len(part):
                found[:, part] = self.fires.planes(int(spell[part[0]]), window)[3:].flatten(1)[:, place[part]]
        return Behaviour(*found)

    def _by_hour(self, arrival: Tensor, came: Tensor, window: Window) -> tuple[Tensor, Tensor]:
        """Return the area burned by each hour [ha] and how far it reaches from the start [m], float32 [b, T]."""
        fire, row, column = came.nonzero(as_tuple=True)
        slot = fire * (len(self.hours) + 1) + torch.bucketize(arrival[came], self.hours * 60.0)
        away = self.fires.cell_size * torch.hypot(
            row + window.top - self.middle[0], column + window.left - self.middle[1]
        )
        shape = len(arrival), len(self.hours) + 1
        count = torch.bincount(slot, minlength=math.prod(shape)).view(shape)
        reach = torch.zeros(math.prod(shape)).scatter_reduce_(0, slot, away, "amax").view(shape)
        hectares = self.fires.cell_size**2 / _HECTARE
        return count[:, :-1].cumsum(1).to(torch.float32) * hectares, reach[:, :-1].cummax(1).values


class Tally:
    """Adds up the counts of fires; of each only its arrival times are kept, in 16 bits.

    Args:
        fires: How many there will be.
        minutes: How long fires are followed.
    """

    def __init__(self, fires: int, minutes: float) -> None:
        self._fires, self._minutes = fires, minutes
        self._counts: list[Count] = []
        self._window: Window | None = None
        self._came, self._sums = torch.zeros(0, 0), torch.zeros(3, 0, 0)

    def add(self, count: Count) -> None:
        """Add the counts of some fires.

        Raises:
            ValueError: If the times of all fires do not fit in memory.
        """
        self.check(count.window)
        self._reach(count.window)
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
    def first(self) -> Tensor:
        """Return when the first fire came, float32 [h, w] [minutes]; NaN where it did not."""
        plane = torch.full(self._came.shape, torch.nan)
        count = self._counts[0]
        plane[count.window.place_in(self.window)] = torch.where(count.first < NEVER / 2, count.first, torch.nan)
        return plane

    def joined(self, name: str) -> Tensor:
        """Return ``area`` [B, T] and ``final`` area [B] [ha], ``progress`` [B, T] [m], ``left`` or ``followed`` [B]."""
        return torch.cat([getattr(count, name) for count in self._counts])

    def burn_probability(self) -> Tensor:
        """Return the share of the fires that came to each cell, float32 [h, w]."""
        return self._came / sum(len(count.left) for count in self._counts)

    def means(self) -> list[Tensor]:
        """Return the mean rate, intensity and flame length over the fires that came, float32 [h, w], NaN for none."""
        return [torch.where(self._came > 0.0, part / self._came, torch.nan) for part in self._sums]

    def arrivals(self) -> Arrivals:
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
        return Arrivals(*found)

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

    def _reach(self, window: Window) -> None:
        """Make room for a window."""
        if self._window is None:
            self._window = window
            self._came, self._sums = (torch.zeros(*n, window.height, window.width) for n in ((), (3,)))
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
        found = torch.full((len(count.times), *shape), _LATE, dtype=torch.int16)
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
        count = (times < _LATE).sum(0)
        found = [_between(times, (count - 1).clamp(min=0) * share) for share in (0.5, 0.1, 0.9)]
        half = times[(len(times) - 1) // 2]
        minutes = (torch.stack([*found, half.to(torch.float32)]) + _STEPS // 2) * (self._minutes / _STEPS)
        return torch.where(torch.stack([count > 0] * 3 + [half < _LATE]), minutes, torch.nan)


def _around(arrival: Tensor, cells: Tensor) -> Tensor:
    """Return the arrival times of the neighbours of some cells, float32 [8, n]; ``NEVER`` beyond the window."""
    height, width = arrival.shape[1:]
    fire, place = cells // (height * width), cells % (height * width)
    around = pad(arrival, (1, 1, 1, 1), value=NEVER).flatten()
    own = (fire * (height + 2) + place // width + 1) * (width + 2) + place % width + 1
    return torch.stack([around[own + row * (width + 2) + column] for row, column in DIRECTIONS])


def _left(came: Tensor, window: Window) -> Tensor:
    """Return which fires came to the map's edge, bool [b]."""
    inside = window.on_map
    ends = (
        (came[:, 0], inside.top == 0),
        (came[:, -1], inside.top + inside.height == window.map[0]),
        (came[:, :, 0], inside.left == 0),
        (came[:, :, inside.width - 1], inside.left + inside.width == window.map[1]),
    )
    sides = [side for side, is_edge in ends if is_edge]
    return torch.cat([torch.zeros(len(came), 1, dtype=torch.bool), *sides], dim=1).any(1)


def _between(times: Tensor, place: Tensor) -> Tensor:
    """Return sorted values [B, n] at fractional places [n], by linear interpolation, float32 [n]."""
    below = place.floor().to(torch.int64)
    low, high = (
        times.gather(0, each[None])[0].to(torch.float32) for each in (below, (below + 1).clamp(max=len(times) - 1))
    )
    part = place - below
    return torch.where(part > 0.0, low + part * (high - low), low)
