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
from warp_torchrl.world.law.travel import NEVER, NOWHERE, Metric, Places, arrival, at_other_rates, rate_from


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
        self._beside = torch.zeros_like(burned)
        self._lay_out((lit.shape[0], lit.shape[1], lit.shape[2]), fuel, pace)
        started = burned.nonzero()[:, 0]
        self._origins[started] = self._place(started)
        self._waiting = self._lit = started[:0]
        self._changed = self._lighted(started)
        self._now = 0.0

    def _lay_out(self, size: tuple[int, int, int], fuel: Tensor, pace: Tensor) -> None:
        """Make what hangs on the size of the map alone (B, H, W)."""
        worlds, height, width = size
        self.shape = (worlds, height + 2, width + 2)
        self._map = (height + 2) * (width + 2)
        self._width = width + 2
        self._fuel = pad(fuel, (1, 1, 1, 1)).flatten()
        self._pace = pad(pace, (1, 1, 1, 1), value=1.0).flatten()
        self._slot = torch.zeros_like(self._origins)
        self._offsets = torch.tensor([row * self._width + column for row, column in DIRECTIONS], device=fuel.device)

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
        cells = self._around(self._changed)
        times, origins = self._coming(travel, cells)
        differ = (times != self._times[cells]) | (origins != self._origins[cells])
        changed = cells[differ]
        self._times[changed], self._origins[changed] = times[differ], origins[differ]
        waiting = self._waiting
        reached = self._times[waiting] <= end
        lit = waiting[reached]
        self._waiting = waiting[~reached]
        self._burned[lit] = True
        self.minutes[lit] = self._times[lit]
        self._lit = lit
        self._changed = torch.cat((changed, self._lighted(lit)))
        self._now = end

    def _lighted(self, lit: Tensor) -> Tensor:
        """Return cells that have caught fire, after their neighbours have joined those that wait."""
        around = (lit[:, None] + self._offsets).flatten()
        around = self._once(
            around[self._fuel[self._place(around).long()] & ~self._burned[around] & ~self._beside[around]]
        )
        self._beside[around] = True
        self._waiting = torch.cat((self._waiting, around))
        return lit

    def _around(self, cells: Tensor) -> Tensor:
        """Return the waiting neighbours of cells, each once."""
        around = (cells[:, None] + self._offsets).flatten()
        return self._once(around[self._beside[around] & ~self._burned[around]])

    def _once(self, cells: Tensor) -> Tensor:
        number = torch.arange(len(cells), dtype=torch.int32, device=cells.device)
        self._slot[cells] = number
        return cells[self._slot[cells] == number]

    def _coming(self, travel: Tensor, cells: Tensor) -> tuple[Tensor, Tensor]:
        around = (self._offsets[:, None] + cells).flatten()
        times = self._times.index_select(0, around).view(8, -1)
        origins = self._origins.index_select(0, around).view(8, -1)
        place = self._place(cells)
        first = cells - place

        def time_of(origin: Tensor) -> Tensor:
            return self.minutes_now.index_select(0, first + origin)

        at = Places(place // self._width, place % self._width, self._width, time_of)
        return arrival(times, origins, self._metric(travel, cells), at)

    @property
    def minutes_now(self) -> Tensor:
        """Return the times in force of the cells that have burned; those of others are not asked for."""
        return self._times

    def _metric(self, travel: Tensor, cells: Tensor) -> Metric:
        pace, place = self._pace.index_select(0, cells), self._place(cells).long()
        if travel.shape[1] > self._map:
            place = place + cells // (len(self._pace) * self._map // travel.shape[1]) * self._map
        slowness, east, north = (part.index_select(0, place) * pace for part in travel)
        return slowness, east, north

    def _place(self, cells: Tensor) -> Tensor:
        return (cells % self._map).to(torch.int32)

    def _change(self, before: Tensor, after: Tensor) -> None:
        """Go on in another weather, as ``RateFire.in_air`` does."""
        around = (self._waiting[:, None] + self._offsets).flatten()
        edge = self._once(around[self._burned[around]])
        self._scale(edge, self._rates_out(before, edge), self._rates_out(after, edge))
        self._scale(self._waiting, self._rates_into(before, self._waiting), self._rates_into(after, self._waiting))
        self._origins[edge] = self._place(edge)
        self._origins[self._waiting] = NOWHERE
        self._changed = torch.cat((edge, self._waiting))

    def _scale(self, cells: Tensor, before: Tensor, after: Tensor) -> None:
        self._times[cells] = at_other_rates(self._times[cells], self._now, before, after)

    def _rates_into(self, travel: Tensor, cells: Tensor) -> Tensor:
        metric, total = self._metric(travel, cells), torch.zeros(len(cells), device=cells.device)
        for direction in range(8):
            neighbour = self._burned[cells + self._offsets[direction]].to(torch.float32)
            total = total + rate_from(direction, metric) * neighbour
        return total

    def _rates_out(self, travel: Tensor, cells: Tensor) -> Tensor:
        total = torch.zeros(len(cells), device=cells.device)
        for direction in range(8):
            target = cells - self._offsets[direction]
            fuel = self._fuel[self._place(target).long()] & ~self._burned[target]
            total = total + rate_from(direction, self._metric(travel, target)) * fuel.to(torch.float32)
        return total
