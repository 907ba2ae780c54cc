"""Figure of embers: a fire at a river with and without them, and how far firebrands fly."""

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import BLUE, CELL, VERMILION, ramp, sheet, show_map
from warp_torchrl.world.arrays.random import Stream, named_key, uniform, world_key
from warp_torchrl.world.behaviour.firebrands import FLIGHT, Firebrands, Plume, landing
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIND = (10.0, 2.0)  # (u, v) [m/s]
_SPRUCE, _WATER = 2, 102  # fuels of the Canadian system
_FRONTS = {"10 MW/m in 10 m/s": (10_000.0, 10.0, BLUE), "30 MW/m in 20 m/s": (30_000.0, 20.0, VERMILION)}


def embers(size: int = 128, minutes: float = 120.0, brands: int = 20_000) -> "Figure":
    """A fire in boreal spruce that comes to a river, without and with embers, and distances that firebrands fly."""
    figure, axes = sheet([["plain", "embers", "distance"]], (10.2, 3.4), "Embers", width_ratios=[1.0, 1.18, 1.0])
    ground, lit = _river(size)
    for name, thrown, title in (("plain", None, "no embers"), ("embers", Firebrands(), "embers=true")):
        image = show_map(axes[name], _arrival(ground, lit, minutes, thrown), cmap=ramp("inferno", 0.15, 0.95))
        image.set_clim(0.0, minutes / 60.0)
        water = torch.where(ground.layers.held["fuel"][0] == _WATER, 1.0, torch.nan)
        show_map(axes[name], water, cmap=ramp("Blues", 0.6, 0.6))
        axes[name].set_title(title)
    figure.colorbar(image, ax=axes["embers"], label="arrival [h]", shrink=0.9)
    _draw_distances(axes["distance"], brands)
    return figure


def _river(size: int) -> tuple[Landscape, Tensor]:
    """Return spruce on both sides of a river that winds from north to south, and a fire west of it."""
    row, column = torch.arange(size)[:, None], torch.arange(size)[None]
    course = 0.4 * size + 0.06 * size * torch.sin(row * 9.0 / size)
    fuel = torch.where((column - course).abs() < 2.0, _WATER, _SPRUCE).to(torch.int16)[None]
    whole = torch.ones(1, size, size, dtype=torch.uint8)
    lit = torch.zeros(size, size, dtype=torch.bool)
    lit[round(0.6 * size), round(0.08 * size)] = True
    return Landscape(whole * 3, whole * 10, None).with_layers(fuel=fuel), lit


def _arrival(ground: Landscape, lit: Tensor, minutes: float, thrown: Firebrands | None) -> Tensor:
    """Return when one fire came to each cell [h], float32 [H, W]; NaN where it did not."""
    spell = Spell(torch.tensor(_WIND), minutes)
    fires = Fires(fire=RateFire(model="fbp"), landscape=ground, spells=[spell], cell_size=CELL, embers=thrown)
    found = on_map(fires.burn(lit, world_key(torch.tensor([1]))))[0]
    return torch.where(found < NEVER / 2, found / 60.0, torch.nan)


def _draw_distances(axes: "Axes", brands: int) -> None:
    """Draw the share of firebrands beyond each distance, drawn and by the equation, and of those that still glow."""
    away = torch.logspace(0.0, 3.5, 200)
    for label, (intensity, speed, colour) in _FRONTS.items():
        mu, sigma, _ = landing(torch.tensor(intensity), torch.tensor(speed))
        beyond = 0.5 * torch.erfc((away.log() - mu) / sigma / 2.0**0.5)
        axes.plot(away, beyond, color=colour, label=label)
        one = torch.ones(brands // 16)
        plume = Plume(one * intensity, one, one * 16.0, one * speed, one * 0.0)
        along, across = (
            uniform(named_key(world_key(torch.arange(len(one))), name), 0, Stream.NAMED, (16,)) for name in FLIGHT
        )
        flight = Firebrands().flown(plume, along, across)
        far, glow = flight.east.flatten(), flight.number.flatten()
        each = away[::12]
        axes.plot(
            each, [(far > a).float().mean() for a in each], color=colour, marker="o", linestyle="none", markersize=3
        )
        axes.plot(away, [(glow * (far > a)).mean() for a in away], color=colour, linestyle="--", linewidth=0.9)
    axes.plot([], [], color="gray", linestyle="--", linewidth=0.9, label="... that still glow")
    axes.set(xscale="log", xlabel="distance along the wind [m]", ylabel="share beyond", ylim=(0.0, 1.35))
    axes.set_title("Firebrands: equation, and draws (dots)")
    axes.legend(loc="upper right")
