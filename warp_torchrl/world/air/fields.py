"""Fields of weather: wind and moisture that differ by place and hour, on a grid of their own over a map."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.state.window import Window

_LEAST = 1e-2  # m/s, of a wind that stands for a field


@dataclass(frozen=True, eq=False)
class Lattice:
    """Points over a map, in rows and columns, between which is interpolated (bilinear).

    Attributes:
        rows: Row of the map in which the first row of points lies, and rows of the map from one to the next.
        columns: The same for columns.
    """

    rows: tuple[float, float]
    columns: tuple[float, float]

    def at(self, values: Tensor, window: Window) -> Tensor:
        """Return values at the points, [..., h, w], in the cells of a window; beyond the last points theirs."""
        below, part = _between(window.top, window.height, *self.rows, values.shape[-2])
        low, high = values.index_select(-2, below), values.index_select(-2, below + 1)
        found = low + part[:, None] * (high - low)
        left, part = _between(window.left, window.width, *self.columns, values.shape[-1])
        low, high = found.index_select(-1, left), found.index_select(-1, left + 1)
        return low + part * (high - low)


@dataclass(frozen=True, eq=False)
class Field:
    """Weather of one hour by place, as it departs from one wind and one moisture that stand for all.

    So an ensemble's other wind changes the field with it: where it is turned, all is turned; where it is stronger, all
    is.

    Attributes:
        lattice: Where its values are.
        wind: The wind over the one that stands for all, a complex number's real and imaginary part, float32 [2, h, w].
        moisture: Factors on the moistures, in the order of ``MOISTURES``, float32 [7, h, w].
    """

    lattice: Lattice
    wind: Tensor
    moisture: Tensor

    def here(self, wind: Tensor, moisture: Tensor, window: Window) -> tuple[Tensor, Tensor]:
        """Return winds and moistures in the cells of a window.

        Args:
            wind: Of each group of fires, float32 [G, 2] [m/s].
            moisture: float32 [G, 7] [%].
            window: Of the map.

        Returns:
            float32 [G, 2, h, w] and [G, h, w, 7].
        """
        real, imaginary = self.lattice.at(self.wind, window)
        east, north = (each[:, None, None] for each in wind.unbind(1))
        winds = torch.stack((real * east - imaginary * north, imaginary * east + real * north), dim=1)
        return winds, (self.lattice.at(self.moisture, window) * moisture[:, :, None, None]).movedim(1, -1)


@dataclass(frozen=True, eq=False)
class WeatherFields:
    """Weather by place, an hour a row.

    Attributes:
        lattice: Where its values are.
        wind: (u east, v north) of the air's motion at 10 m, float32 [T, 2, h, w] [m/s].
        moisture: In the order of ``MOISTURES``, float32 [T, 7, h, w] [%]; a row and kind that is not known by place is
            NaN.
        air: Temperature [C], relative humidity [%], and 1 where rain falls, else 0, float32 [T, 3, h, w]; None where
            they are not known by place.
    """

    lattice: Lattice
    wind: Tensor
    moisture: Tensor
    air: Tensor | None = None

    @property
    def means(self) -> tuple[Tensor, Tensor]:
        """Return the wind and the moisture that stand for each row, float32 [T, 2] and [T, 7]; NaN where not known.

        The wind has the mean speed and the bearing of the mean.
        """
        mean = self.wind.mean((2, 3))
        speed, length = self.wind.square().sum(1).sqrt().mean((1, 2)), mean.square().sum(1).sqrt()
        still = (length < _LEAST)[:, None]
        towards = torch.where(still, torch.tensor([1.0, 0.0]), mean / length.clamp(min=_LEAST)[:, None])
        return towards * speed.clamp(min=_LEAST)[:, None], self.moisture.mean((2, 3))

    def at(self, row: int) -> Field:
        """Return the field of a row."""
        winds, moistures = self.means
        (u, v), (east, north) = self.wind[row], winds[row]
        over = 1.0 / winds[row].square().sum()
        wind = torch.stack(((u * east + v * north) * over, (v * east - u * north) * over))
        factors = self.moisture[row] / moistures[row][:, None, None].clamp(min=1e-3)
        return Field(self.lattice, wind, factors.nan_to_num(1.0))


def _between(start: int, count: int, first: float, step: float, points: int) -> tuple[Tensor, Tensor]:
    """Return the point before each of some cells, int64 [count], and the share of the way to the next one."""
    place = (torch.arange(start, start + count, dtype=torch.float64) - first) / step
    place = place.clamp(0.0, max(points - 1.0, 0.0))
    before = place.floor().clamp(max=max(points - 2.0, 0.0))
    return before.long(), (place - before).to(torch.float32)
