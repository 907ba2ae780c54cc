"""Wind over hills: one wind over the whole map, steady, drawn or by the hour, bent by each landscape's ground."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Literal

from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.hills import Hills, bent
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.air.wind import Uniform, Wind
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.terrain.source import LandscapeSource


@dataclass(frozen=True, kw_only=True, eq=False)
class Terrain(Wind):
    """A mass-consistent wind: ``Hills`` of one wind over the whole map, whose landscapes have an elevation.

    The hills of a landscape are computed once, at the start of an episode; a tick takes a product for each cell.

    Attributes:
        speed: Wind speed over level ground at 10 m [m/s]; of a pair, from low to high, each episode draws its own.
        direction: Where the air goes, degrees from east, counter-clockwise (90 is north); None draws it for each
            episode.
        path: A table of weather, see ``Weather``, in place of speed and direction.
        start: Hours into the table at which episodes begin; None draws the row.
        wind_height: Height at which the table's wind was measured; None takes the file's.
        units: Unit by quantity or column where the table states none.
        minutes_per_tick: Minutes of a tick; None takes those of the fire.
        hills: How hills bend it.

    Raises:
        ValueError: If a value is out of its range, or the table cannot be read.
    """

    speed: float | tuple[float, float] = 4.0
    direction: float | None = None
    path: str | PathLike[str] | None = None
    start: float | None = 0.0
    wind_height: Literal["10m", "20ft"] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    minutes_per_tick: float | None = None
    hills: Hills = field(default_factory=Hills)
    _weather: Weather | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, speed=(0.0, 60.0), direction=(-1e6, 1e6))
        if self.path is not None:
            weather = Weather(
                path=self.path,
                start=self.start,
                wind_height=self.wind_height,
                units=self.units,
                minutes_per_tick=self.minutes_per_tick,
            )
            object.__setattr__(self, "_weather", weather)

    @property
    def changes(self) -> bool:
        """Return whether it has a table of more than one row."""
        return self._weather is not None and self._weather.changes

    def over(self, landscape: LandscapeSource) -> "Terrain":
        """Return this wind with its table's bearings from the landscape's grid north."""
        return self if self._weather is None else self._with(self._weather.over(landscape))

    def paced(self, minutes: float | None) -> "Terrain":
        """Return this wind for ticks of ``minutes``, see ``Weather.paced``."""
        return self if self._weather is None else self._with(self._weather.paced(minutes))

    def shaped(self, ground: Landscape, cell_size: float) -> Landscape:
        """Return landscapes with the layers of ``Hills``."""
        return self.hills.shaped(ground, cell_size)

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the wind over level ground of each world at the start, float32 [B, 2, 1, 1] [m/s]."""
        if self._weather is not None:
            return self._weather(key, size, corner)
        if not isinstance(self.speed, tuple):
            return Uniform(speed=self.speed, direction=self.direction)(key, size)
        low, high = self.speed
        drawn = low + (high - low) * uniform(key, 1, Stream.WIND, (1, 1, 1))
        return Uniform(speed=1.0, direction=self.direction)(key, size) * drawn

    def on(self, key: Tensor, ground: Landscape) -> Tensor:
        """See ``Wind``: float32 [B, 2, H, W] over hills."""
        return bent(super().on(key, ground), ground)

    def after_tick(self, state: WorldState) -> Tensor:
        """See ``Wind``."""
        return state.wind if self._weather is None else bent(self._weather.after_tick(state), state.landscape)

    def moisture(self, key: Tensor, tick: Tensor) -> Tensor | None:
        """See ``Wind``."""
        return None if self._weather is None else self._weather.moisture(key, tick)

    def hours(self, key: Tensor, ground: Landscape) -> Iterator[tuple[Tensor, Tensor | None]]:
        """See ``Wind``."""
        winds = super().hours(key, ground) if self._weather is None else self._bent_hours(self._weather, key, ground)
        yield from winds

    def _bent_hours(self, weather: Weather, key: Tensor, ground: Landscape) -> Iterator[tuple[Tensor, Tensor | None]]:
        for wind, moisture in weather.hours(key, ground):
            yield bent(wind, ground), moisture

    def _with(self, weather: Weather) -> "Terrain":
        made = replace(self, path=None)
        object.__setattr__(made, "_weather", weather)
        return made
