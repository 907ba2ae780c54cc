"""Fires on the paper's maps: progress without and with terrain and wind."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from drawings.measures import snapshots
from warp_torchrl.env.pictures.drawing import (
    CELL,
    INK,
    SOFT,
    axis_places,
    contours,
    fire_image,
    fire_legend,
    relief,
    sheet,
    show_map,
)
from warp_torchrl.world.air.wind import Calm, Paper
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.landscape import Perlin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AUTOMATON = Fire(growth=True, beta=0.65, p_regrow=0.01)
"""The complete automaton of the paper."""


def fire_plain(size: int = 100, seed: int = 0, at: tuple[int, ...] = (440, 450, 460, 470)) -> "Figure":
    """Fire without terrain and wind, on level forest, ticks 440 to 470 (WARP-CA, figure of these frames).

    Lightning starts the fires. The seed was chosen so that some burn at these ticks.
    """
    ground = Perlin(size=size, levels=(0.0, 0.0, 0.0))(world_key(torch.tensor([seed])))
    figure, axes = sheet(_two_rows(at), (6.2, 6.75), "Fire without terrain and wind: level forest, calm air")
    for tick, state in zip(at, snapshots(ground, AUTOMATON, Calm(), at, seed, CELL)):
        show_map(axes[str(tick)], fire_image(state))
        axes[str(tick)].set_title(_burning(tick, state.cells))
    fire_legend(figure)
    return figure


def fire_terrain_wind(size: int = 100, seed: int = 6, at: tuple[int, ...] = (350, 360, 370, 380)) -> "Figure":
    """Fire over terrain and in the paper's wind, ticks 350 to 380 (WARP-CA, figure of these frames).

    Lightning starts the fires. The seed was chosen so that some burn at these ticks.
    """
    ground = Perlin(size=size, relief=100.0)(world_key(torch.tensor([seed])))
    title = "Fire with terrain and wind: 100 m of relief, the paper's wind field"
    figure, axes = sheet(_two_rows(at), (6.2, 7.1), title)
    for tick, state in zip(at, snapshots(ground, AUTOMATON, Paper(), at, seed, CELL)):
        panel = axes[str(tick)]
        show_map(panel, fire_image(state))
        contours(panel, relief(ground), levels=[35.0, 65.0], colors="white", linewidths=0.5, alpha=0.5)
        fastest = _arrows(panel, state.wind[0])
        panel.set_title(_burning(tick, state.cells))
    covers = (Cover.LAKE, Cover.WETLAND, Cover.GRASSLAND, Cover.FOREST)
    lines = {
        "contours at 35 and 65 m": {"color": "#a8a8a8", "linewidth": 0.9},
        f"wind, longest arrow {fastest:.0f} m/s": {"color": SOFT, "marker": ">", "linewidth": 1.2, "markersize": 4.5},
    }
    fire_legend(figure, covers, lines)
    return figure


def _arrows(axes: "Axes", wind: Tensor, count: int = 4) -> float:
    """Draw a wind field [2, H, W] [m/s] as count x count arrows and return the longest one's speed [m/s]."""
    from matplotlib.patheffects import withStroke

    height, width = wind.shape[1:]
    rows = torch.linspace(0, height - 1, 2 * count + 1)[1::2].long()
    columns = torch.linspace(0, width - 1, 2 * count + 1)[1::2].long()
    u, v = wind[:, rows][:, :, columns].numpy()
    axes.quiver(
        axis_places(width)[columns], axis_places(height, descending=True)[rows], u, v, color="white", pivot="middle",
        scale=75.0, width=0.009, headwidth=4.0, path_effects=[withStroke(linewidth=1.6, foreground=INK)],
    )  # fmt: skip
    return float(np.hypot(u, v).max())


def _burning(tick: int, cells: Tensor) -> str:
    return f"tick {tick}: {int(is_burning(cells).sum())} cells burn"


def _two_rows(at: tuple[int, ...]) -> list[list[str]]:
    names = [str(tick) for tick in at]
    return [names[: len(names) // 2], names[len(names) // 2 :]]
