"""State of live fuel on the day that a fire starts, where neither the user nor the weather gives it."""

from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime

import torch

from warp_torchrl.world.behaviour.fbp import days_from_lowest, foliar_moisture
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.weather.season import (
    DAYS,
    GREEN,
    SHORT_DAY,
    curing_of,
    day_length,
    live_moistures,
    season_index,
)
from warp_torchrl.world.weather.table import WeatherTable

_LEAVES = 30
"""Days after the lowest foliar moisture on which leaves are out, as FireSTARR has it: the spring dip of ST-X-3 ends."""
_CANADA = ((41.0, 84.0), (-170.0, -50.0))
"""Degrees north and east, Alaska with it, for which the equations of foliar moisture hold."""
_OF_HERBS = ("live_herbaceous", "live_woody")


@dataclass(frozen=True, kw_only=True)
class Season:
    """Place and time of a fire, which determine its live fuel.

    Attributes:
        latitude: Of the map's middle [degrees north].
        longitude: [degrees east].
        elevation: Mean of the map [m]; None where it has none.
        start: Of the fire, minutes after the weather's first row.
    """

    latitude: float
    longitude: float
    elevation: float | None
    start: float

    def __call__(self, law: RateFire, weather: WeatherTable) -> tuple[RateFire, WeatherTable, str]:
        """Return the law and the weather with what they leave open, and in a line what that is.

        Raises:
            ValueError: If the weather has no dates, or Canadian fuel lies elsewhere.
        """
        day, index = self._day(weather), self._index(weather)
        told = [f"day {day} of the year"]
        told.append(
            f"{DAYS} days of weather before the start: " + (f"index {index:.2f}" if index is not None else "no")
        )
        if law.bed.table is not None:
            return self._rothermel(law, weather, index, told)
        return self._canadian(law, weather, day, index, told)

    def _rothermel(
        self, law: RateFire, weather: WeatherTable, index: float | None, told: list[str]
    ) -> tuple[RateFire, WeatherTable, str]:
        known = {name for name in _OF_HERBS if name in law.moisture or getattr(weather, name) is not None}
        if index is None:
            told.append("live moistures are those of fire.moisture")
            return law, weather, "; ".join(told)
        values = dict(zip(_OF_HERBS, live_moistures(index), strict=True))
        made = {name: value for name, value in values.items() if name not in known}
        told += [f"{name} {value:.0f} %" for name, value in made.items()]
        columns = {name: torch.full_like(weather.hours, value) for name, value in made.items()}
        return law, replace(weather, **columns), "; ".join(told)  # type: ignore[arg-type]

    def _canadian(
        self, law: RateFire, weather: WeatherTable, day: int, index: float | None, told: list[str]
    ) -> tuple[RateFire, WeatherTable, str]:
        (south, north), (west, east) = _CANADA
        if not (south <= self.latitude <= north and west <= self.longitude <= east):
            raise ValueError(
                f"season=date knows Canada and Alaska in Canadian fuel, got {self.latitude:.1f}, {self.longitude:.1f}: "
                f"give fire.foliar_moisture, fire.green and fire.curing"
            )
        place = (self.latitude, self.longitude, day, self.elevation)
        since = float(days_from_lowest(*place))
        leaves = since >= _LEAVES and day_length(self.latitude, day) >= SHORT_DAY if index is None else index >= GREEN
        values: dict[str, float | bool] = {"foliar_moisture": float(foliar_moisture(*place)), "green": leaves}
        if index is not None:
            values["curing"] = curing_of(live_moistures(index)[0])
        open_now = {each.name for each in fields(law) if getattr(law, each.name) is None}
        made = {name: value for name, value in values.items() if name in open_now}
        told += [
            f"fire.{name} {value if isinstance(value, bool) else f'{value:.0f} %'}" for name, value in made.items()
        ]
        if index is None and law.curing is None:
            told.append("fire.curing 80 %, which no date tells")
        return law.with_state(**made), weather, "; ".join(told)

    def _day(self, weather: WeatherTable) -> int:
        if weather.began is None:
            raise ValueError("season=date needs dates in the weather, in one order of day and month, got none")
        start = datetime.fromtimestamp(3600.0 * weather.began + 60.0 * self.start, UTC)
        return start.timetuple().tm_yday

    def _index(self, weather: WeatherTable) -> float | None:
        if weather.temperature is None or weather.humidity is None:
            return None
        hours = weather.hours - self.start / 60.0
        return season_index(hours, weather.temperature, weather.humidity, self._day(weather), self.latitude)
