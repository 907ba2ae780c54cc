"""Spells of constant weather, and the heads of fires in them."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.backends.spreading import Hour
from warp_torchrl.world.behaviour.moistures import moisture_row
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law.fuel_bed import gradient
from warp_torchrl.world.law.rate import TICKS_PER_CELL, RateFire
from warp_torchrl.world.law.travel import travel
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

BUT_FASTEST = 0.999
"""Share of the cells whose rates set the ticks."""
_LEAST_TICKS = 4  # of a spell: the fire's edge follows from the times of the tick before


@dataclass(frozen=True, eq=False)
class Spell:
    """A time of constant weather."""

    wind: Tensor  # (u east, v north) of the air's motion at 10 m, float32 [2] [m/s]
    minutes: float  # how long it lasts
    moisture: Tensor | None = None  # float32 [7], in the order of ``moistures.MOISTURES``, NaN where not known


def spread_in(
    fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell, window: Window | None = None
) -> Spread:
    """Return the behaviour of a fire's head in each cell of a landscape in a spell, [1, H, W], or of a window."""
    row = moisture_row(fire.moisture)
    moisture = row if spell.moisture is None else torch.where(spell.moisture.isnan(), row, spell.moisture)
    air = spell.wind[None, :, None, None], moisture[None], cell_size
    if window is None:
        return fire.bed.spread(landscape, *air)
    return fire.bed.spread(window.landscape(landscape), *air, rise=_rise(landscape, window, cell_size))


def can_ignite(fire: RateFire, landscape: Landscape) -> Tensor:
    """Return the cells of one landscape that can ignite, bool [H, W]."""
    return (fire.flammability(landscape)[0] > 0.0) & (landscape.age[0] >= fire.youngest_fuel)


def hour_of(fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell, fuel: Tensor) -> Hour:
    """Return the travel times in a spell, and ticks as short as its fastest cells but one in a thousand need.

    Args:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        cell_size: Side of a cell [m].
        spell: The weather.
        fuel: Cells that can ignite, bool [H, W].
    """
    spread = spread_in(fire, landscape, cell_size, spell)
    rates = spread.head[0][fuel]
    fastest = float(rates.kthvalue(max(1, math.ceil(BUT_FASTEST * len(rates)))).values) if len(rates) else 0.0
    ticks = ticks_of(spell.minutes, fastest, cell_size)
    made = travel(spread.head, spread.direction, spread.length_to_breadth, cell_size)[0]
    return Hour(made, spell.minutes / ticks, ticks)


def ticks_of(minutes: float, fastest: float, cell_size: float) -> int:
    """Return the ticks of some minutes in which the fastest fire [m/min] crosses half a cell [m]."""
    return max(_LEAST_TICKS, math.ceil(TICKS_PER_CELL * minutes * fastest / cell_size))


def heads(spread: Spread) -> Tensor:
    """Return the fields of ``HeadBehaviour`` for a spread [1, h, w], float32 [4, h, w].

    The rear spreads at R_head (1 - e) / (1 + e), e the eccentricity of the ellipse.
    """
    focus = (1.0 - spread.length_to_breadth.pow(-2)).clamp(min=0.0).sqrt()
    backing = spread.head * (1.0 - focus) / (1.0 + focus)
    return torch.cat((spread.head, backing, spread.intensity, spread.flame_length))


def _rise(landscape: Landscape, window: Window, cell_size: float) -> Tensor:
    """Return the gradient of a window's ground, float32 [1, 2, h, w]."""
    cover = window.around(landscape.cover)
    if landscape.elevation is None:
        return gradient(None, cover, cell_size)
    return gradient(window.around(landscape.elevation, margin=1), cover, cell_size)[:, :, 1:-1, 1:-1]
