"""Figure of wind over hills: a field of it, and ridges against theory."""

import math
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import BLUE, CELL, VERMILION, axis_places, contours, ramp, sheet, show_map
from warp_torchrl.world.air.hills import Hills
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.terrain.landscape import Perlin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIND = (3.0, 4.0)  # (u, v) [m/s]
_RIDGES = (10.0, 20.0, 40.0, 60.0, 80.0, 100.0)  # heights [m]
_WAVE = 1000.0  # length of a ridge and a valley [m]


def hills(size: int = 128, relief: float = 250.0, ridges: tuple[float, ...] = _RIDGES, seed: int = 4) -> "Figure":
    """Wind of 5 m/s over hills, and the speed-up on the crests of cosine ridges beside linear theory."""
    figure, axes = sheet([["map", "crests"]], (7.2, 3.6), "Wind over hills", width_ratios=[1.25, 1.0])
    _draw_field(figure, axes["map"], _elevation(size, relief, seed))
    _draw_crests(axes["crests"], ridges)
    return figure


def crest_speed_up(height: float, cells: int = 96) -> tuple[float, float]:
    """Return the speed-up on the crest of a cosine ridge, found and by linear theory."""
    side, k, roughness = 2.0 * _WAVE / cells, 2.0 * math.pi / _WAVE, Hills().roughness
    across = (torch.arange(cells) + 0.5 - cells / 2) * side
    ridge = (height / 2.0 * torch.cos(k * across)).expand(1, cells, cells)
    found = Hills().factors(ridge.contiguous(), side)[0, 0, cells // 2, cells // 2 - 1 : cells // 2 + 1].mean()
    mean = (-0.5772 - math.log(k * roughness) + k * roughness) / math.log(10.0 / roughness)
    return float(found) - 1.0, k * height / 2.0 * mean


def _elevation(size: int, relief: float, seed: int) -> Tensor:
    land = Perlin(size=size, relief=relief, octaves=2, scale=size / 5.0)(world_key(torch.tensor([seed])))
    if land.elevation is None:
        raise ValueError("relief must be over 0")
    return land.elevation


def _draw_field(figure: "Figure", axes: "Axes", elevation: Tensor) -> None:
    """Draw the speed as colour, the ground as contours and the way of the air as streamlines."""
    east_u, east_v, north_u, north_v = Hills().factors(elevation, CELL)[0]
    u, v = _WIND[0] * east_u + _WIND[1] * north_u, _WIND[0] * east_v + _WIND[1] * north_v
    image = show_map(axes, torch.hypot(u, v), cmap=ramp("viridis", 0.1, 1.0))
    contours(axes, elevation[0], colors="white", linewidths=0.6, alpha=0.8)
    places = axis_places(len(u))
    axes.streamplot(
        places, places, u.flip(0).numpy(), v.flip(0).numpy(), color="black", linewidth=0.5, density=0.9, arrowsize=0.7
    )
    axes.set(xlim=(0.0, len(u) * CELL / 1000.0), ylim=(0.0, len(u) * CELL / 1000.0))
    axes.set_title(f"5 m/s over level ground, hills of {float(np.ptp(elevation.numpy())):.0f} m")
    figure.colorbar(image, ax=axes, label="wind at 10 m [m/s]", shrink=0.9)


def _draw_crests(axes: "Axes", ridges: tuple[float, ...]) -> None:
    """Draw the speed-up on crests over the height of the ridges."""
    found, theory = zip(*(crest_speed_up(each) for each in ridges), strict=True)
    axes.plot(ridges, theory, color=VERMILION, label="linear theory")
    axes.plot(ridges, found, color=BLUE, marker="o", linestyle="none", label="solver")
    axes.set(xlabel="height of the ridge [m]", ylabel="speed-up on the crest at 10 m", ylim=(0.0, None))
    axes.set_title("Cosine ridges 1 km apart")
    axes.legend(loc="upper left")
