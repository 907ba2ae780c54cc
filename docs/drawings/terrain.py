"""Figures of terrain: noise, its scales, and land cover."""

from typing import TYPE_CHECKING, Literal

import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import (
    CELL,
    contours,
    cover_image,
    cover_legend,
    hillshade,
    relief,
    sheet,
    show_map,
)
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.landscape import Perlin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COVERS = (Cover.LAKE, Cover.WETLAND, Cover.GRASSLAND, Cover.FOREST)
_READINGS: dict[Literal["quantile", "minmax", "printed"], str] = {
    "quantile": "quantile (default): lowest 6, 16, 36 % of the map",
    "minmax": "minmax: noise under 0.06, 0.16, 0.36",
    "printed": "printed: noise under 0.01, 0.2, 0.01",
}


def noise(size: int = 256, seed: int = 3) -> "Figure":
    """Smoothed noise that terrain is made of, scaled to 0..1 (WARP-CA, figure of the noise map)."""
    figure, axes = sheet([["map"]], (4.6, 3.9), "Fractal gradient noise")
    image = show_map(axes["map"], _noise(Perlin(size=size), seed), cmap="gray", vmin=0.0, vmax=1.0)
    axes["map"].set_title("scale 15 cells, 6 octaves, persistence 0.5, lacunarity 2")
    figure.colorbar(image, ax=axes["map"], label="noise n", ticks=[0.0, 0.25, 0.5, 0.75, 1.0], shrink=0.9)
    return figure


def noise_scales(size: int = 256, seed: int = 3, scales: tuple[int, ...] = (50, 100, 150, 200)) -> "Figure":
    """Noise of one seed at scales from 50 to 200 cells (WARP-CA, figure of the noise scales)."""
    layout = [[str(scale) for scale in scales]]
    figure, axes = sheet(layout, (7.2, 2.35), "Noise of the same seed at four scales")
    for scale in scales:
        panel = axes[str(scale)]
        image = show_map(panel, _noise(Perlin(size=size, scale=scale), seed), cmap="gray", vmin=0.0, vmax=1.0)
        panel.set_title(f"scale {scale} cells, {scale * CELL / 1000.0:g} km")
    figure.colorbar(image, ax=list(axes.values()), label="noise n", ticks=[0.0, 0.5, 1.0], shrink=0.8, pad=0.01)
    return figure


def cover(size: int = 160, seed: int = 3) -> "Figure":
    """Land cover of one terrain under the three readings of the paper's thresholds (WARP-CA, terrain types)."""
    layout = [["quantile", "quantile", "minmax"], ["quantile", "quantile", "printed"]]
    figure, axes = sheet(layout, (6.6, 4.75), "Land cover from one noise map, by the thresholds on it")
    for name, meaning in _READINGS.items():
        ground = Perlin(size=size, relief=100.0, thresholds=name)(world_key(torch.tensor([seed])))
        elevation = relief(ground)
        show_map(axes[name], cover_image(ground.cover[0], hillshade(elevation, exaggeration=2.5)))
        if name == "quantile":
            contours(axes[name], elevation, levels=[20.0, 40.0, 60.0, 80.0], colors="black", linewidths=0.35, alpha=0.5)
        axes[name].set_title(f"{meaning}\n{_shares(ground.cover[0])}", fontsize=8.5 if name == "quantile" else 7.0)
    cover_legend(figure, _COVERS, {"contours every 20 m": {"color": "black", "linewidth": 0.5, "alpha": 0.6}})
    return figure


def _noise(perlin: Perlin, seed: int) -> Tensor:
    return perlin.noise(world_key(torch.tensor([seed])))[0]


def _shares(covers: Tensor) -> str:
    shares = [100.0 * (covers == code).float().mean().item() for code in _COVERS]
    return "lake {:.0f}, wetland {:.0f}, grass {:.0f}, forest {:.0f} %".format(*shares)
