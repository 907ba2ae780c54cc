"""Counts of some fires in their window of the map: area, reach and burned cells by time."""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.fires.alone import Burned, Fires
from warp_torchrl.world.law.passing import HeadBehaviour, passing, steepness_from
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.window import COLUMNS, Window

TIME_STEPS = 65534
"""Of a time in 16 bits, over the whole time."""
LATE = 32767
"""Stands for a fire that does not come."""
_HECTARE = 10_000.0  # [m2]


@dataclass(frozen=True, kw_only=True, eq=False)
class Count:
    """What some fires did, counted in their window."""

    window: Window
    came: Tensor  # how many fires came, float32 [h, w]
    sums: Tensor  # over them of rate [m/min], intensity [kW/m], flame length [m], and more: ``passing``; [3 or 5, h, w]
    times: Tensor  # when each fire came, int16 [b, h, w]
    area: Tensor  # burned by each hour, float32 [b, T] [ha]
    final: Tensor  # burned in the end, float32 [b] [ha]
    progress: Tensor  # the farthest from the start by each hour, float32 [b, T] [m]
    left: Tensor  # whether it came to the map's edge, bool [b]
    followed: Tensor  # for how long, float32 [b] [minutes]
    first: Tensor  # arrival of the first fire, float32 [h, w] [minutes]


@dataclass(frozen=True, kw_only=True, eq=False)
class Counter:
    """Counts of fires that have burned.

    Attributes:
        fires: Map and weather of the fires.
        lit: Where they start, bool [H, W].
        minutes: Time for which fires are followed [minutes].
        area: Area at which they stop [ha]; None for no limit.
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
        steps = (arrival * (TIME_STEPS / self.minutes)).round() - TIME_STEPS // 2
        return torch.where(came, steps, LATE).to(torch.int16)

    def _sums(self, arrival: Tensor, burned: Burned) -> Tensor:
        """Return the sums of what ``passing`` returns over the fires, float32 [3, h, w], or 5 with crown fire.

        Where a fire did not come, or was lit, it adds 0.
        """
        cells = ((arrival > 0.0) & (arrival < NEVER / 2)).flatten().nonzero()[:, 0]
        count, sums = len(cells), torch.zeros(5 if self.fires.runs_in_crowns else 3, *arrival.shape[1:])
        if not count:
            return sums
        cells = torch.cat((cells, cells[:1].expand(-count % COLUMNS)))  # vectors that are filled
        times = arrival.flatten()[cells]
        then = self._then(cells, times, burned)
        steep = steepness_from(_around(arrival, cells), times)
        for number, values in enumerate(passing(steep, burned.pace.flatten()[cells], then, self.fires.cell_size)):
            plane = torch.zeros(arrival.numel())
            plane[cells] = values
            sums[number] = plane.view(arrival.shape).sum(0)
        return sums

    def _then(self, cells: Tensor, times: Tensor, burned: Burned) -> HeadBehaviour:
        """Return what heads do in cells of the fires' planes at some times, float32 [n]."""
        window, groups = burned.window, burned.fires.groups
        fires_each = len(burned.minutes) // groups
        place = cells % window.cells + cells // window.cells // fires_each * window.cells
        spell = torch.bucketize(times, self._ends).clamp(max=len(self._ends) - 1)
        order = spell.argsort()
        found = torch.empty(5 if self.fires.runs_in_crowns else 4, len(place))
        for part in order.split(torch.bincount(spell).tolist()):
            if len(part):
                heads = burned.fires.planes(int(spell[part[0]]), window)[:, 3:].transpose(0, 1)
                found[:, part] = heads.flatten(1)[:, place[part]]
        return HeadBehaviour(*found)

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


def _around(arrival: Tensor, cells: Tensor) -> Tensor:
    """Return the arrival times of the neighbours of some cells, float32 [8, n]; ``NEVER`` beyond the window."""
    height, width = arrival.shape[1:]
    fire, place = cells // (height * width), cells % (height * width)
    around = pad(arrival, (1, 1, 1, 1), value=NEVER).flatten()
    own = (fire * (height + 2) + place // width + 1) * (width + 2) + place % width + 1
    return torch.stack([around[own + row * (width + 2) + column] for row, column in DIRECTIONS])


def _left(came: Tensor, window: Window) -> Tensor:
    """Return which fires reached the map's edge, bool [b]."""
    inside = window.on_map
    ends = (
        (came[:, 0], inside.top == 0),
        (came[:, -1], inside.top + inside.height == window.map[0]),
        (came[:, :, 0], inside.left == 0),
        (came[:, :, inside.width - 1], inside.left + inside.width == window.map[1]),
    )
    sides = [side for side, is_edge in ends if is_edge]
    return torch.cat([torch.zeros(len(came), 1, dtype=torch.bool), *sides], dim=1).any(1)
