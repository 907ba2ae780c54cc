"""Dead fuel moisture by aspect, slope and shade, hour by hour: the tables of ``weather.fosberg`` on a map."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.world.air.fields import WeatherFields
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
        level: Of fine fuel on level ground without crowns, the mean of the aspects, float32 [] [%].
        is_overcast: Whether clouds shade all ground.
        dry: Where no rain falls, 1, else 0, at the points of the weather's fields, float32 [h, w]; None where the
            moisture of level ground is one everywhere.
    """

    fine: Tensor
    level: Tensor
    is_overcast: bool = False
    dry: Tensor | None = None

    def factors(self, rise: Tensor, canopy: Tensor | None, level: Tensor | None = None) -> Tensor:
        """Return factors on the moistures of level ground, float32 [B, H, W, 7].

        Args:
            rise: How steeply the ground rises to the east and north, float32 [B, 2, H, W].
            canopy: Cover of crowns, [B, H, W] [%]; None where there are none.
            level: By place, the moistures of dead fuel on level ground over their means, and how far it is dry, float32
                [H, W, 4]; None where they are one everywhere.
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
        if level is None:
            found[..., :_DEAD] = (fine[..., None] + thicker) / (self.level + thicker)
        else:
            added = (fine - self.level)[..., None] * level[..., _DEAD:]
            found[..., :_DEAD] = 1.0 + added / (level[..., :_DEAD] * (self.level + thicker))
        return found


class Sunlit(NamedTuple):
    """Weather whose dead moistures are those of level ground, and how they differ by aspect, slope and shade."""

    table: WeatherTable
    fields: WeatherFields | None
    sunlight: list[Sunlight]


def by_sunlight(
    table: WeatherTable,
    fields: WeatherFields | None = None,
    longitude: float | None = None,
    *,
    in_south: bool = False,
) -> Sunlit:
    """Return weather whose dead moistures are those of level ground in the open, and how they differ by place.

    The sun's hour is that of the rows' clock; where they are in UTC, or state their zone, that of the longitude. Where
    it rains fine fuel has ``RAINING``. Where the fields know the air by place, level ground differs with it; clouds are
    those of the rows.

    Args:
        table: The weather, with temperature, humidity and dates.
        fields: The same by place; None where it is one everywhere.
        longitude: Of the map [degrees east]; None where it is not known.
        in_south: Whether it lies south of the equator, where the sun stands in the north, and January is as July.

    Raises:
        ValueError: If the table lacks one of these, or the fields have moistures of dead fuel but no air.
    """
    if table.temperature is None or table.humidity is None:
        raise ValueError("moisture=fosberg needs temperature and humidity in the weather, got none")
    if table.began is None:
        raise ValueError("moisture=fosberg needs dates in the weather, in one order of day and month, got none")
    air = None if fields is None else fields.air
    if fields is not None and air is None and not bool(fields.moisture[:, :_DEAD].isnan().all()):
        raise ValueError("moisture=fosberg computes moistures of dead fuel, which rasters of the weather give by place")
    added = torch.stack([_added(table, row, longitude, in_south) for row in range(len(table.hours))])
    cloud, rain = (torch.zeros_like(table.hours) if each is None else each for each in (table.cloud, table.rain))
    overcast = cloud >= SHADY
    in_open = torch.where(overcast, added[:, 2].mean(1), added[:, 0].mean(1))
    wet, reference = rain > 0.0, reference_moisture(table.temperature, table.humidity)
    level = torch.where(wet, RAINING, reference + in_open)
    fine = torch.where(wet[:, None, None], RAINING, reference[:, None, None] + added)
    dry: Sequence[Tensor | None] = [None] * len(level)
    if fields is not None and air is not None:
        is_dry = air[:, 2] < 0.5
        ground = torch.where(is_dry, reference_moisture(air[:, 0], air[:, 1]) + in_open[:, None, None], RAINING)
        dead = ground[:, None] + _THICKER[:, None, None]
        fields = replace(fields, moisture=torch.cat((dead, fields.moisture[:, _DEAD:]), dim=1))
        level, dry = ground.mean((1, 2)), is_dry.float().unbind()
        fine = level[:, None, None] + (added - in_open[:, None, None])
    known = {f"dead_{name}h": level + more for name, more in zip((1, 10, 100), _THICKER.tolist(), strict=True)}
    each = zip(fine, level, overcast.tolist(), dry, strict=True)
    return Sunlit(replace(table, **known), fields, [Sunlight(*one) for one in each])


def _added(table: WeatherTable, row: int, longitude: float | None, in_south: bool) -> Tensor:
    """Return what is added to the reference moisture in a row, by ground and aspect, float32 [3, 4] [%]."""
    hours = float(table.hours[row]) + _ahead(table, longitude)
    sun = datetime.fromtimestamp(3600.0 * ((table.began or 0.0) + hours), UTC)
    return _correction(sun.month, sun.hour + sun.minute / 60.0, in_south)


def _correction(month: int, hour: float, in_south: bool) -> Tensor:
    return correction((month + 5) % 12 + 1, hour)[:, [2, 1, 0, 3]] if in_south else correction(month, hour)


def _ahead(table: WeatherTable, longitude: float | None) -> float:
    """Return the hours that the sun is ahead of the rows' clock."""
    if table.zone is None or longitude is None:
        return 0.0
    return longitude / _DEGREES_AN_HOUR - table.zone
