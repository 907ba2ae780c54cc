"""Wind and moisture by the hour, from a table of weather."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.fields import Field, WeatherFields
from warp_torchrl.world.air.sunlight import Sunlight
from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.terrain.source import LandscapeSource
from warp_torchrl.world.weather.convergence import grid_convergence
from warp_torchrl.world.weather.table import OPEN_10M_OVER_20FT, WeatherTable, read_weather

_MINUTES = 60.0  # of an hour
_LEAST = 0.5  # m/s, of a wind that has gusts


@dataclass(frozen=True, kw_only=True, eq=False)
class Weather(Wind):
    """One wind over the whole map that changes with the rows of a table, and with it the moisture of fuel.

    Speeds are converted to 10 m in the open, bearings to grid north.

    Attributes:
        path: A CSV file, or ``august``, see ``world.weather.table.read_weather``; None where a table is passed.
        table: The table.
        start: Hours into the table at which episodes begin; None draws the row that each episode begins with.
        wind_height: Height at which the wind was measured; None takes the file's.
        units: Unit by quantity or column where the file states none, see ``read_weather``.
        true_north: Whether bearings are from true north, and are turned if the landscape has a place on Earth; else
            they are from grid north.
        convergence: Angle from true north to grid north [degrees]; None is that at the middle of the landscape.
        minutes_per_tick: Minutes of a tick; None takes those of the fire.
        fields: The same hours by place, for ``by_place``; the rows are their means.
        sunlight: How dead fuel differs by aspect, slope and shade in each row; the rows are level ground.

    Raises:
        ValueError: If there is no table, or the file cannot be read.
    """

    path: str | PathLike[str] | None = None
    table: WeatherTable | None = field(default=None, repr=False)
    start: float | None = 0.0
    wind_height: Literal["10m", "20ft"] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    true_north: bool = True
    convergence: float | None = None
    minutes_per_tick: float | None = None
    fields: WeatherFields | None = field(default=None, repr=False)
    sunlight: Sequence[Sunlight] | None = field(default=None, repr=False)
    _rows: WeatherTable = field(init=False, repr=False)
    _wind: Tensor = field(init=False, repr=False)  # float32 [T, 2], (u, v) [m/s]
    _moisture: Tensor = field(init=False, repr=False)  # float32 [T, 7], NaN where not known

    def __post_init__(self) -> None:
        check_fields(self, start=(0.0, 1e6), convergence=(-180.0, 180.0), minutes_per_tick=(1e-3, 1440.0))
        if self.table is not None and self.path is not None:
            raise ValueError(f"path must be null where a table is passed, got {self.path}")
        if self.table is None and self.path is None:
            raise ValueError("path must name a CSV file of weather, got null")
        rows = self.table or read_weather(str(self.path), wind_height=self.wind_height, units=self.units)
        object.__setattr__(self, "_rows", rows)
        object.__setattr__(self, "_wind", _components(rows, self.convergence or 0.0))
        object.__setattr__(self, "_moisture", _moistures(rows))

    @property
    def changes(self) -> bool:
        """Return whether the table has more than one row."""
        return len(self._rows.hours) > 1

    def over(self, landscape: LandscapeSource) -> "Weather":
        """Return this weather with its bearings from the landscape's grid north."""
        grid = getattr(landscape, "grid", None)
        if grid is None or grid.crs is None or not self.true_north or self.convergence is not None:
            return self
        x, y = grid.transform * (grid.shape[1] / 2.0, grid.shape[0] / 2.0)
        return replace(self, path=None, table=self._rows, convergence=grid_convergence(grid.crs.to_wkt(), x, y))

    def paced(self, minutes: float | None) -> "Weather":
        """Return this weather for ticks of ``minutes``, unless it has minutes per tick itself.

        Raises:
            ValueError: If both are None.
        """
        if self.minutes_per_tick is not None:
            return self
        if minutes is None:
            raise ValueError("wind.minutes_per_tick must be given where ticks of the fire have no minutes, got null")
        return replace(self, path=None, table=self._rows, minutes_per_tick=minutes)

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the wind of each world at the start, float32 [B, 2, 1, 1] [m/s]."""
        return self._wind.to(key.device)[self._row(key, torch.zeros_like(key))][:, :, None, None]

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the wind of each world after its tick number ``state.tick``, float32 [B, 2, 1, 1] [m/s]."""
        return self._wind.to(state.key.device)[self._row(state.episode_key, state.tick)][:, :, None, None]

    def moisture(self, key: Tensor, tick: Tensor) -> Tensor:
        """See ``Wind``; NaN where the table has no value."""
        return self._moisture.to(key.device)[self._row(key, tick)]

    def hours(self, key: Tensor, ground: Landscape) -> Iterator[tuple[Tensor, Tensor | None]]:
        """Return the wind and moisture of each row."""
        for wind, moisture in zip(self._wind, self._moisture, strict=True):
            yield wind.expand(len(key), 2)[:, :, None, None], moisture.expand(len(key), -1)

    def by_place(self, row: int) -> Field | None:
        """Return how the weather of a row differs by place; None where it is the same everywhere."""
        return None if self.fields is None else self.fields.at(row)

    def in_sun(self, row: int) -> Sunlight | None:
        """Return how dead fuel differs by aspect, slope and shade in a row; None where it does not."""
        return None if self.sunlight is None else self.sunlight[row]

    def gust(self, row: int) -> float:
        """Return the gusts over the mean wind of a row; 1 where none are known."""
        gusts, speed = self._rows.wind_gust, float(self._rows.wind_speed[row])
        if gusts is None or math.isnan(gusts[row]) or speed < _LEAST:
            return 1.0
        return max(1.0, float(gusts[row]) / speed)

    def spells(self, minutes: float, start: float = 0.0) -> Iterator[tuple[int, Tensor, Tensor, float]]:
        """Return the row, the wind [2], the moisture [7] and the minutes of each spell until some minutes have gone.

        Args:
            minutes: How long the spells last together.
            start: Minutes into the table at which the first begins.
        """
        begins = self._rows.hours.double() * _MINUTES
        ends = [*begins[1:].tolist(), math.inf]
        for row, (begin, end) in enumerate(zip(begins.tolist(), ends, strict=True)):
            first, last = max(begin if row else -math.inf, start), min(end, start + minutes)
            if last > first:
                yield row, self._wind[row], self._moisture[row], last - first

    def _row(self, key: Tensor, tick: Tensor) -> Tensor:
        """Return the row of each world, int64 [B]."""
        begins = (self._rows.hours * _MINUTES).to(key.device)
        if self.start is None:
            draw = uniform(key, 0, Stream.WEATHER, (1,))[:, 0]
            begun = begins[(draw * len(begins)).long()]
        else:
            begun = torch.full_like(key, self.start * _MINUTES, dtype=torch.float32)
        now = begun + tick * (self.minutes_per_tick or 1.0)
        return (torch.searchsorted(begins, now, right=True) - 1).clamp(min=0)


def _components(rows: WeatherTable, convergence: float) -> Tensor:
    """Return (u east, v north) of the wind at 10 m of each row, float32 [T, 2] [m/s]."""
    speed = rows.wind_speed * (OPEN_10M_OVER_20FT if rows.wind_height == "20ft" else 1.0)
    angle = torch.deg2rad(rows.wind_bearing - convergence)
    return torch.stack((-speed * angle.sin(), -speed * angle.cos()), dim=1)


def _moistures(rows: WeatherTable) -> Tensor:
    """Return the moistures of each row in the order of ``MOISTURES``, float32 [T, 7]; NaN where not known."""
    unknown = torch.full_like(rows.hours, math.nan)
    known = [getattr(rows, name) for name in MOISTURES]
    return torch.stack([unknown if each is None else each for each in known], dim=1)
