"""Dead fuel moisture by aspect, slope and shade, hour by hour: the tables of ``weather.fosberg`` on a map."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.weather.dead_moisture import RAINING
from warp_torchrl.world.weather.fosberg import SHADY, STEEP, correction, reference_moisture
from warp_torchrl.world.weather.table import WeatherTable

_THICKER = torch.tensor([0.0, 1.0, 2.0])
"""How much moister dead fuel of 1, 10 and 100 hours is than fine fuel [%] (Rothermel 1983)."""
_LEVEL = 0.01  # rise over run under which ground has no aspect
_DEAD = 3  # moistures of dead fuel, the first of ``MOISTURES``
_DEGREES_AN_HOUR = 15.0


@dataclass(frozen=True, eq=False)
class Sunlight:
    """How the moisture of dead fuel differs by place in one hour.

    Attributes:
        fine: Of fine fuel on gentle, steep and shaded ground of each aspect, float32 [3, 4] [%].
        is_overcast: Whether clouds shade all ground.
    """

    fine: Tensor
    is_overcast: bool = False

    @property
    def level(self) -> Tensor:
        """Return the moisture of fine fuel on level ground without crowns, the mean of the aspects, float32 [] [%]."""
        return self.fine[2 if self.is_overcast else 0].mean()

    def factors(self, rise: Tensor, canopy: Tensor | None) -> Tensor:
        """Return factors on the moistures of level ground, float32 [B, H, W, 7].

        Args:
            rise: How steeply the ground rises to the east and north, float32 [B, 2, H, W].
            canopy: Cover of crowns, [B, H, W] [%]; None where there are none.
        """
        east, north = rise.unbind(1)
        steepness = torch.hypot(east, north)
        downhill = torch.rad2deg(torch.atan2(-east, -north)) % 360.0
        aspect = ((downhill + 45.0) % 360.0 / 90.0).long().clamp(max=3)
        kind = (steepness > STEEP).long()
        if canopy is not None:
            kind = torch.where(canopy >= SHADY, 2, kind)
        kind = torch.full_like(kind, 2) if self.is_overcast else kind
        fine = torch.where(steepness < _LEVEL, self.fine.mean(1)[kind], self.fine[kind, aspect])
        found = torch.ones(*fine.shape, len(MOISTURES), device=fine.device)
        thicker = _THICKER.to(fine.device)
        found[..., :_DEAD] = (fine[..., None] + thicker) / (self.level + thicker)
        return found


def by_sunlight(
    table: WeatherTable, longitude: float | None = None, *, in_south: bool = False
) -> tuple[WeatherTable, list[Sunlight]]:
    """Return a table whose dead moistures are those of level ground in the open, and how they differ by place.

    The sun's hour is that of the rows' clock; where they are in UTC, or state their zone, that of the longitude. Where
    it rains fine fuel has ``RAINING`` everywhere.

    Args:
        table: The weather, with temperature, humidity and dates.
        longitude: Of the map [degrees east]; None where it is not known.
        in_south: Whether it lies south of the equator, where the sun stands in the north, and January is as July.

    Raises:
        ValueError: If the table lacks one of these.
    """
    if table.temperature is None or table.humidity is None:
        raise ValueError("moisture=fosberg needs temperature and humidity in the weather, got none")
    if table.began is None:
        raise ValueError("moisture=fosberg needs dates in the weather, in one order of day and month, got none")
    fine = reference_moisture(table.temperature, table.humidity)
    found = []
    for row, hours in enumerate(table.hours.tolist()):
        sun = datetime.fromtimestamp(3600.0 * (table.began + hours + _ahead(table, longitude)), UTC)
        added = _correction(sun.month, sun.hour + sun.minute / 60.0, in_south)
        is_overcast = table.cloud is not None and float(table.cloud[row]) >= SHADY
        is_wet = table.rain is not None and float(table.rain[row]) > 0.0
        moisture = torch.full_like(added, RAINING) if is_wet else fine[row] + added
        found.append(Sunlight(moisture, is_overcast))
    level = torch.stack([each.level for each in found])
    dead = {f"dead_{name}h": level + more for name, more in zip((1, 10, 100), _THICKER.tolist(), strict=True)}
    return replace(table, **dead), found


def _correction(month: int, hour: float, in_south: bool) -> Tensor:
    return correction((month + 5) % 12 + 1, hour)[:, [2, 1, 0, 3]] if in_south else correction(month, hour)


def _ahead(table: WeatherTable, longitude: float | None) -> float:
    """Return the hours that the sun is ahead of the rows' clock."""
    if table.zone is None or longitude is None:
        return 0.0
    return longitude / _DEGREES_AN_HOUR - table.zone
