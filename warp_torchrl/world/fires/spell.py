"""Spells of constant weather, and the heads of fires in them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from warp_torchrl.world.air.fields import Field
from warp_torchrl.world.air.hills import FACTORS, bent
from warp_torchrl.world.air.sunlight import Sunlight
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.behaviour.moistures import in_force, moisture_row
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law.listed import gradient
from warp_torchrl.world.law.passing import head_behaviour
from warp_torchrl.world.law.rate import TICKS_PER_CELL, RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

BUT_FASTEST = 0.999
"""Share of the cells whose rates set the ticks."""
_SPREAD_AT_ONCE = 2**20  # cells of groups whose rates are computed at once
_DEAD = 3  # moistures of dead fuel, the first of ``MOISTURES``
_LEAST_TICKS = 4  # of a spell: the fire's edge follows from the times of the tick before


@dataclass(frozen=True, eq=False)
class Spell:
    """A time of constant weather: one for all fires, or one for each of G groups of fires."""

    wind: Tensor  # (u east, v north) of the air's motion at 10 m, float32 [2] or [G, 2] [m/s]
    minutes: float  # how long it lasts
    moisture: Tensor | None = None  # float32 [7] or [G, 7], in the order of ``moistures.MOISTURES``, NaN where unknown
    fastest: "Spell | None" = None  # weather that sets the ticks where groups differ
    field: Field | None = None  # how it differs by place; None: nowhere
    sunlight: Sunlight | None = None  # how dead fuel differs by aspect, slope and shade; None: nowhere
    gust: float = 1.0  # gusts over the mean wind
    block: int | None = None  # number of the draw of its wind between mean and gust; None: the mean
    young: tuple[float, float] | None = None  # minutes since ignition of a fire that accelerates; None: it does not

    @property
    def groups(self) -> int:
        """Return the number of groups."""
        return len(self.wind) if self.wind.dim() == 2 else 1

    def here(self, wind: Tensor, moisture: Tensor, window: Window) -> tuple[Tensor, Tensor]:
        """Return winds [G, 2, 1, 1] or [G, 2, h, w] and moistures [G, 7] or [G, h, w, 7] of a window over level ground.

        Args:
            wind: Of some groups, float32 [G, 2] [m/s].
            moisture: float32 [G, 7] [%].
            window: Of the map.
        """
        return (wind[:, :, None, None], moisture) if self.field is None else self.field.here(wind, moisture, window)

    def level(self, window: Window) -> Tensor | None:
        """Return the dead moistures of level ground in a window over their means, and how far it is dry.

        Returns:
            float32 [h, w, 4], see ``Sunlight.factors``; None where they are one everywhere.
        """
        if self.field is None or self.sunlight is None or self.sunlight.dry is None:
            return None
        planes = torch.cat((self.field.moisture[:_DEAD], self.sunlight.dry[None]))
        return self.field.lattice.at(planes, window).movedim(0, -1)

    def of(self, groups: slice) -> "Spell":
        """Return the weather of some groups."""
        if self.wind.dim() == 1:
            return self
        moisture = self.moisture if self.moisture is None or self.moisture.dim() == 1 else self.moisture[groups]
        return replace(self, wind=self.wind[groups], moisture=moisture)


def spells_of(air: Weather, minutes: float, start: float = 0.0) -> list[Spell]:
    """Return the spells of some minutes of weather, from some minutes after its first row began."""
    return [
        Spell(wind, lasts, moisture, field=air.by_place(row), sunlight=air.in_sun(row), gust=air.gust(row))
        for row, wind, moisture, lasts in air.spells(minutes, start)
    ]


def spread_in(
    fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell, window: Window | None = None
) -> Spread:
    """Return the behaviour of a fire's head in each cell of a landscape in a spell, [G, H, W], or of a window."""
    row = moisture_row(fire.moisture)
    moisture = in_force(spell.moisture, row)
    winds = spell.wind.reshape(-1, 2)
    moistures = moisture.reshape(-1, len(row)).expand(len(winds), -1)
    ground, rise = landscape, None
    if window is not None:
        ground, rise = window.landscape(landscape), rise_of(landscape, window, cell_size)
    if spell.sunlight is not None and rise is None:
        rise = gradient(landscape.elevation, landscape.cover, cell_size)
    at_once = max(1, _SPREAD_AT_ONCE // ground.cover.numel())
    place = Window.whole((landscape.cover.shape[1], landscape.cover.shape[2])) if window is None else window
    level = spell.level(place)
    parts = [
        fire.bed.spread(
            ground, bent(air, ground), in_sun(spell, moist, ground, rise, level), cell_size, rise, spell.young
        )
        for air, moist in (
            spell.here(*each, place) for each in zip(winds.split(at_once), moistures.split(at_once), strict=True)
        )
    ]
    return parts[0] if len(parts) == 1 else _joined(parts)


def air_in(
    fire: RateFire, landscape: Landscape, spell: Spell, window: Window, cell_size: float
) -> tuple[Tensor, Tensor]:
    """Return winds [G, 2, 1, 1] or [G, 2, h, w] [m/s] and moistures [G, 7] or [G, h, w, 7] [%] in a window."""
    winds, row = spell.wind.reshape(-1, 2), moisture_row(fire.moisture)
    moistures = in_force(spell.moisture, row).reshape(-1, len(row)).expand(len(winds), -1)
    air, moist = spell.here(winds, moistures, window)
    if spell.sunlight is not None:
        rise, level = rise_of(landscape, window, cell_size), spell.level(window)
        moist = in_sun(spell, moist, window.landscape(landscape), rise, level)
    return (air if landscape.layer(FACTORS[0]) is None else bent(air, window.landscape(landscape))), moist


def can_ignite(fire: RateFire, landscape: Landscape) -> Tensor:
    """Return the cells of one landscape that can ignite, bool [H, W]."""
    return (fire.flammability(landscape)[0] > 0.0) & (landscape.age[0] >= fire.youngest_fuel)


def ticks_of(minutes: float, fastest: float, cell_size: float) -> int:
    """Return the ticks of some minutes in which the fastest fire [m/min] crosses half a cell [m]."""
    return max(_LEAST_TICKS, math.ceil(TICKS_PER_CELL * minutes * fastest / cell_size))


def heads(spread: Spread, with_kind: bool = False) -> Tensor:
    """Return the fields of ``HeadBehaviour`` for a spread [G, h, w], float32 [G, 4, h, w]; 5 with the kind of fire."""
    then, kind = head_behaviour(spread), (spread.kind,) if with_kind else ()
    return torch.stack((then.head, then.backing, then.intensity, then.flame_length, *kind), dim=1)


def in_sun(
    spell: Spell, moisture: Tensor, ground: Landscape, rise: Tensor | None, level: Tensor | None = None
) -> Tensor:
    """Return moistures [G, 7] or [G, h, w, 7] by aspect, slope and shade, [G, h, w, 7]; level: see ``Spell.level``."""
    if spell.sunlight is None or rise is None:
        return moisture
    moisture = moisture[:, None, None] if moisture.dim() == 2 else moisture
    return moisture * spell.sunlight.factors(rise, ground.layer("canopy_cover"), level)


def rise_of(landscape: Landscape, window: Window, cell_size: float) -> Tensor:
    """Return the gradient of a window's ground, float32 [1, 2, h, w]."""
    cover = window.around(landscape.cover)
    if landscape.elevation is None:
        return gradient(None, cover, cell_size)
    return gradient(window.around(landscape.elevation, margin=1), cover, cell_size)[:, :, 1:-1, 1:-1]


def _joined(parts: Sequence[Spread]) -> Spread:
    """Return the spreads of further groups behind those of the first."""
    return Spread(**{each.name: torch.cat([getattr(part, each.name) for part in parts]) for each in fields(Spread)})
