"""Sums over many fires on one map, some fires at a time."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.prediction.passing import Behaviour, passing
from warp_torchrl.world.travel import NEVER

_STEPS = 65534  # of a time in 16 bits, over the whole time
_LATE = 32767  # stands for a fire that does not come
_BLOCK = 2**24  # times that are sorted at once


@dataclass(frozen=True, eq=False)
class Arrivals:
    """When fires reached each cell, over the fires that did; float32 [H, W] [minutes], NaN where none did."""

    median: Tensor
    early: Tensor  # a tenth of the fires came before
    late: Tensor  # and a tenth after
    half: Tensor  # when half of all fires had come; NaN where they never had


class Tally:
    """Counts fires as they are burned; only their arrival times are kept, in 16 bits.

    Args:
        behaviour: What fire does in each cell, by spell.
        lit: Where fires start, bool [H, W].
        minutes: How long fires are followed.
        cell_size: Side of a cell [m].
        area: Area at which fires stop [ha]; None lets them go on.
    """

    def __init__(self, behaviour: Behaviour, lit: Tensor, minutes: float, cell_size: float, area: float | None) -> None:
        self._behaviour, self._minutes, self._cell_size = behaviour, minutes, cell_size
        self._cells = None if area is None else math.ceil(area * 10_000.0 / cell_size**2 - 1e-6)
        self._away = _distance(lit, cell_size)
        self.hours = torch.arange(math.floor(minutes / 60.0 + 1e-6) + 1, dtype=torch.float32)
        self._came = torch.zeros(lit.shape)
        self._sums = torch.zeros(3, *lit.shape)
        names = ("times", "area", "final", "progress", "left", "followed")
        self._parts: dict[str, list[Tensor]] = {name: [] for name in names}
        self.first: Tensor | None = None

    def add(self, arrival: Tensor, pace: Tensor) -> None:
        """Count fires that came at some minutes, float32 [B, H, W], ``travel.NEVER`` where they did not."""
        followed = self._followed(arrival)
        arrival = torch.where(arrival <= followed[:, None, None], arrival, NEVER)
        came = arrival < NEVER / 2
        self._came += came.sum(0)
        self._sums += torch.stack([each.sum(0) for each in passing(arrival, pace, self._behaviour, self._cell_size)])
        edge = torch.cat((came[:, 0], came[:, -1], came[:, :, 0], came[:, :, -1]), dim=1)
        steps = (arrival * (_STEPS / self._minutes)).round() - _STEPS // 2
        self._parts["times"].append(torch.where(came, steps, _LATE).to(torch.int16).flatten(1))
        self._parts["left"].append(edge.any(1))
        self._parts["followed"].append(followed)
        self._parts["final"].append(came.sum((1, 2)) * (self._cell_size**2 / 10_000.0))
        area, progress = self._by_hour(arrival)
        self._parts["area"].append(area)
        self._parts["progress"].append(progress)
        self.first = arrival[0].clone() if self.first is None else self.first

    def joined(self, name: str) -> Tensor:
        """Return ``area`` [B, T] and ``final`` area [B] [ha], ``progress`` [B, T] [m], ``left`` or ``followed`` [B]."""
        return torch.cat(self._parts[name])

    def burn_probability(self) -> Tensor:
        """Return the share of the fires that came to each cell, float32 [H, W]."""
        return self._came / sum(len(part) for part in self._parts["left"])

    def means(self) -> list[Tensor]:
        """Return the mean rate, intensity and flame length over the fires that came, float32 [H, W], NaN for none."""
        return [torch.where(self._came > 0.0, part / self._came, torch.nan) for part in self._sums]

    def arrivals(self) -> Arrivals:
        """Return quantiles of the arrival times, to a 65,534th of the time that fires are followed."""
        times, shape = torch.cat(self._parts["times"]), self._came.shape
        columns = times.split(max(1, _BLOCK // len(times)), dim=1)
        found = torch.cat([self._quantiles(part.sort(dim=0).values) for part in columns], dim=1)
        return Arrivals(*(part.view(shape) for part in found))

    def _quantiles(self, times: Tensor) -> Tensor:
        """Return median, early, late and half of sorted times [B, n], float32 [4, n]."""
        count = (times < _LATE).sum(0)
        found = [_between(times, (count - 1).clamp(min=0) * share) for share in (0.5, 0.1, 0.9)]
        half = times[(len(times) - 1) // 2]
        minutes = (torch.stack([*found, half.to(torch.float32)]) + _STEPS // 2) * (self._minutes / _STEPS)
        return torch.where(torch.stack([count > 0] * 3 + [half < _LATE]), minutes, torch.nan)

    def _followed(self, arrival: Tensor) -> Tensor:
        """Return for how long each fire is followed, float32 [B] [minutes]."""
        whole = torch.full((len(arrival),), self._minutes)
        if self._cells is None or self._cells > arrival[0].numel():
            return whole
        return torch.minimum(whole, arrival.flatten(1).kthvalue(max(1, self._cells), dim=1).values)

    def _by_hour(self, arrival: Tensor) -> tuple[Tensor, Tensor]:
        """Return the area burned by each hour [ha] and how far it reaches from the start [m], float32 [B, T]."""
        hour = torch.bucketize(arrival.flatten(1), self.hours * 60.0)
        count = torch.zeros(len(arrival), len(self.hours) + 1)
        count.scatter_add_(1, hour, torch.ones(1).expand(hour.shape))
        reach = torch.zeros_like(count)
        reach.scatter_reduce_(1, hour, self._away.flatten().expand(hour.shape), "amax")
        hectares = self._cell_size**2 / 10_000.0
        return count[:, :-1].cumsum(1) * hectares, reach[:, :-1].cummax(1).values


def _between(times: Tensor, place: Tensor) -> Tensor:
    """Return sorted values [B, n] at fractional places [n], by linear interpolation, float32 [n]."""
    below = place.floor().to(torch.int64)
    low, high = (
        times.gather(0, each[None])[0].to(torch.float32) for each in (below, (below + 1).clamp(max=len(times) - 1))
    )
    part = place - below
    return torch.where(part > 0.0, low + part * (high - low), low)


def _distance(lit: Tensor, cell_size: float) -> Tensor:
    """Return the distance of each cell from the middle of the cells that are lit, float32 [H, W] [m]."""
    row, column = lit.nonzero().to(torch.float32).mean(0)
    rows = torch.arange(lit.shape[0])[:, None] - row
    return cell_size * torch.hypot(rows.expand(lit.shape), (torch.arange(lit.shape[1]) - column).expand(lit.shape))
