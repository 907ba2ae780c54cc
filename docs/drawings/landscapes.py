"""Fires on real ground."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import (
    INK,
    contours,
    cover_image,
    cover_legend,
    hillshade,
    ramp,
    relief,
    round_length,
    sheet,
    show_map,
    wind_arrow,
)
from warp_torchrl.prediction.simulation import fire_history
from warp_torchrl.world.air.wind import Wandering
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.burn import FireHistory
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.state.state import FIRST_FIRE, Cover, Landscape
from warp_torchrl.world.terrain.raster import Raster

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FIRE = HazardFire(kernel="ellipse", refinement=2, alpha=(0.0, 0.05, 0.7, 0.55, 0.0))
_WIND = Wandering(speed=4.0, direction=0.0, direction_deviation=25.0)
_EVERY = 30  # ticks between the lines of mean arrival
_CONTOURS = {"color": "black", "linewidth": 0.5, "alpha": 0.6}
_IGNITION = {"marker": "*", "color": "white", "markeredgecolor": "black", "markersize": 10, "linestyle": "none"}


def burn_probability(landscape: str | Path, size: int = 128, worlds: int = 200, ticks: int = 160) -> "Figure":
    """How likely a fire on real ground is to reach each cell, from one ignition (ours; needs --landscape).

    Forests' ages, the wind and the fire differ from seed to seed; the ground and the ignition do not. Forest and
    grassland are less flammable than the paper's, as on a damp day, so that not every fire takes all. Where under 2 %
    of the fires come, the relief shows; lines of mean arrival stand where 25 % do.

    Args:
        landscape: Folder of rasters, as ``Raster`` reads them; the fire burns in their middle.
        size: Side of the map, or that of the rasters where they are smaller [cells].
        worlds: Fires.
        ticks: Fire ticks, of which two make one of the paper's.
    """
    source = middle_of(landscape, size)
    ground = source(world_key(torch.arange(worlds)))
    lit = ignition(ground.cover[0])
    history = fires_from(ground, lit, ticks, source.cell_size)
    light = hillshade(relief(ground), source.cell_size)
    figure, axes = sheet([["cover", "probability"]], (7.2, 4.4), f"{worlds} fires from one ignition on real ground")
    step = _draw_cover(axes["cover"], ground, light, source.cell_size)
    _draw_probability(figure, axes["probability"], history, light)
    wind_arrow(axes["probability"], _WIND.speed, 0.0)
    for panel in axes.values():
        place = ((lit[1] + 0.5), (ground.cover.shape[1] - lit[0] - 0.5))
        panel.plot(*(number * source.cell_size / 1000.0 for number in place), **_IGNITION)
    marks = {
        f"contours every {step:g} m": _CONTOURS,
        f"mean arrival every {_EVERY} ticks": {"color": INK, "linewidth": 1.2},
        "ignition": _IGNITION,
    }
    cover_legend(figure, (Cover.LAKE, Cover.GRASSLAND, Cover.FOREST, Cover.BARE), marks)
    return figure


def _draw_cover(axes: "Axes", ground: Landscape, light: Tensor, cell_size: float) -> float:
    """Draw land cover and contours; return the height between these [m]."""
    elevation = relief(ground)
    low, high = (bound.item() for bound in elevation.aminmax())
    step = round_length(max(8.0, high - low) / 8.0)
    levels = [step * number for number in range(int(low // step), int(high // step) + 1)]
    show_map(axes, cover_image(ground.cover[0], light), cell_size)
    contours(axes, elevation, cell_size, levels=levels, colors="black", linewidths=0.35, alpha=0.6)
    axes.set_title(f"land cover and relief, {low:.0f} to {high:.0f} m")
    return step


def _draw_probability(figure: "Figure", axes: "Axes", history: FireHistory, light: Tensor) -> None:
    """Draw the share of fires that reach each cell over the relief, and when they do on average."""
    probability, arrival = history.burn_probability(), history.mean_arrival()
    show_map(axes, light, history.cell_size, cmap="gray", vmin=-0.2, vmax=1.0)
    seen = np.ma.masked_less(probability.numpy(), 0.02)
    image = show_map(axes, seen, history.cell_size, cmap=ramp("plasma_r", 0.0, 0.95), vmin=0.0, vmax=1.0, alpha=0.8)
    often = torch.where(probability >= 0.25, arrival, torch.nan)
    levels = [float(tick) for tick in range(_EVERY, history.alight.shape[1], _EVERY)]
    contours(axes, often, history.cell_size, levels=levels, colors=INK, linewidths=0.8)
    figure.colorbar(image, ax=axes, label="burn probability", location="bottom", shrink=0.8, pad=0.02)
    axes.set_title(
        f"burn probability in {history.alight.shape[1] - 1} ticks, wind about {_WIND.speed:g} m/s to the east"
    )


def middle_of(landscape: str | Path, size: int) -> Raster:
    """Return the window of so many cells a side in the middle of a folder of rasters."""
    rows, columns = Raster(path=landscape, size=8, min_fuel=0.0).extent
    side = (min(size, rows), min(size, columns))
    return Raster(path=landscape, size=side, row=(rows - side[0]) // 2, column=(columns - side[1]) // 2)


def ignition(cover: Tensor) -> tuple[int, int]:
    """Return the grass or forest nearest to a third of the way from the west of a map [H, W]."""
    height, width = cover.shape
    down, across = torch.arange(height)[:, None] - height // 2, torch.arange(width)[None, :] - width // 3
    fuel = (cover == Cover.FOREST) | (cover == Cover.GRASSLAND)
    nearest = torch.where(fuel, down.square() + across.square(), height**2 + width**2).argmin()
    return divmod(int(nearest), width)


def fires_from(ground: Landscape, lit: tuple[int, int], ticks: int, cell_size: float) -> FireHistory:
    """Burn every world from the same 3 x 3 cells."""
    cells = ground.age.clone()
    patch = (slice(None), slice(lit[0] - 1, lit[0] + 2), slice(lit[1] - 1, lit[1] + 2))
    cells[patch] = FIRST_FIRE
    return fire_history(cells, ground.cover, ground.elevation, _WIND, _FIRE, ticks=ticks, cell_size=cell_size)
