"""Figure of winds: the paper's field, a uniform wind and a wandering one."""

import math
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import BLUE, CELL, GRID, VERMILION, axis_places, ramp, sheet
from warp_torchrl.world.air.wind import Paper, Wandering
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.burn import burn, start_burning
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Landscape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SPEED, _TOWARDS = 4.0, 45.0  # of the uniform wind, and the means of the one that wanders [m/s], [degrees]


def wind(size: int = 100, ticks: int = 300, seed: int = 1) -> "Figure":
    """Wind field of the paper; beside it a uniform wind and one that wanders (WARP-CA, figure of the wind)."""
    layout = [["field", "hodograph"], ["field", "speed"], ["field", "direction"]]
    ratios = {"width_ratios": [1.35, 1.0], "height_ratios": [2.4, 1.0, 1.0]}
    figure, axes = sheet(layout, (7.2, 4.9), "Winds; arrows point where the air goes", **ratios)
    _draw_field(figure, axes["field"], Paper()(world_key(torch.tensor([seed])), (size, size))[0])
    _draw_wandering(axes, wandering_wind(ticks, seed))
    return figure


def wandering_wind(ticks: int, seed: int) -> Tensor:
    """Return (u, v) of a wind that wanders about 4 m/s to the north-east, after each tick, float32 [T + 1, 2]."""
    air = Wandering(speed=_SPEED, direction=_TOWARDS)
    empty = torch.zeros(1, 4, 4, dtype=torch.uint8)
    state = start_burning(
        Landscape(empty, empty, None), wind=air, fire=Fire(), first_tick=0, stage_age=None, seed=seed, cell_size=CELL
    )
    trace = [state.wind]
    for _ in range(ticks):
        state = burn(state, Fire(), air, 1)
        trace.append(state.wind)
    return torch.cat(trace)[:, :, 0, 0]


def _draw_field(figure: "Figure", axes: "Axes", field: Tensor) -> None:
    """Draw the paper's field: speed as colour, streamlines, and both scales of the axes."""
    side = field.shape[1] * CELL / 1000.0
    u, v = field.numpy()
    speed = np.hypot(u, v)
    middle = axis_places(field.shape[1])
    lines = axes.streamplot(
        middle, middle, u[::-1], v[::-1], color=speed[::-1], cmap=ramp("viridis_r", 0.12, 1.0),
        linewidth=0.7 + 1.3 * speed[::-1] / speed.max(), density=1.15, arrowsize=0.9,
    )  # fmt: skip
    axes.set(xlim=(0.0, side), ylim=(0.0, side), xlabel="east [km]", ylabel="north [km]")
    for name, axis in (("X", axes.secondary_xaxis), ("Y", axes.secondary_yaxis)):
        second = axis(
            "top" if name == "X" else "right", functions=(lambda x: 6 * x / side - 3, lambda x: (x + 3) * side / 6)
        )
        second.set_xlabel(name) if name == "X" else second.set_ylabel(name, rotation=0)
    axes.set_title("Paper: $U = -1 - X^2 + X + Y$, $V = (1 + X^2 - Y^2) / 10$ m/s")
    figure.colorbar(lines.lines, ax=axes, label="wind speed [m/s]", location="bottom", shrink=0.8, pad=0.02)


def _draw_wandering(axes: dict[str, "Axes"], trace: Tensor) -> None:
    """Draw the wind that wanders as a hodograph, coloured by time, and its speed and direction in time."""
    u, v = trace.numpy().T
    time = np.arange(len(u))
    hodograph = axes["hodograph"]
    hodograph.axhline(0.0, color=GRID, zorder=0)
    hodograph.axvline(0.0, color=GRID, zorder=0)
    hodograph.plot(u, v, color=BLUE, linewidth=0.7, alpha=0.8, label="wandering", marker=".", markersize=2.0)
    mean = _SPEED * math.cos(math.radians(_TOWARDS)), _SPEED * math.sin(math.radians(_TOWARDS))
    hodograph.annotate("", mean, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": VERMILION, "linewidth": 1.6})
    hodograph.plot([], [], color=VERMILION, linewidth=1.6, label="uniform")
    hodograph.set(xlabel="u east [m/s]", ylabel="v north [m/s]", title="Uniform and wandering wind")
    hodograph.set_aspect("equal", adjustable="datalim")
    hodograph.legend(loc="lower left")
    direction = np.degrees(np.unwrap(np.arctan2(v, u)))
    for name, values, mean_value, unit in (
        ("speed", np.hypot(u, v), _SPEED, "speed [m/s]"),
        ("direction", direction, _TOWARDS, "towards [°]"),
    ):
        axes[name].axhline(mean_value, color=VERMILION, linewidth=1.0)
        axes[name].plot(time, values, color=BLUE, linewidth=0.8)
        axes[name].set(ylabel=unit, xlim=(0, time[-1]))
        axes[name].spines[["top", "right"]].set_visible(False)
    axes["speed"].set_ylim(0.0, None)
    axes["speed"].set_xticklabels([])
    axes["direction"].set_xlabel("fire ticks")
