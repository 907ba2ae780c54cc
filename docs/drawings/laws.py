"""Figures of the fire laws: round fronts, ellipses in wind, and fire sizes."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from drawings.measures import (
    burned_in_wind,
    diagonal_over_axis,
    fires_in_wind,
    fitted_exponent,
    length_over_breadth,
    point_fires,
    strike_and_burn,
)
from warp_torchrl.env.pictures.drawing import (
    BLUE,
    CELL,
    INK,
    PURPLE,
    VERMILION,
    contours,
    fire_image,
    fire_legend,
    line_legend,
    ramp,
    scale_bar,
    sheet,
    show_map,
)
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.wind_and_slope import head_factor, length_to_breadth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FRONTS = {  # the automaton of each panel of ``isotropy``
    "law paper, diagonal unit": Fire(diagonal="unit"),
    "law paper, diagonal distance": Fire(),
    "law hazard, k = 8": HazardFire(alpha=Fire.alpha, refinement=8),
}


def isotropy(reach: int = 40, worlds: int = 24) -> "Figure":
    """Where the front of a calm fire on level forest stands, and circles (ours)."""
    title = f"Fronts of calm fires on level forest, mean of {worlds} fires, and circles through them on the axes"
    figure, axes = sheet([list(_FRONTS)], (7.2, 3.0), title)
    for name, fire in _FRONTS.items():
        arrival = front(fire, reach, worlds)
        _draw_front(axes[name], arrival, reach)
        ratio = diagonal_over_axis(arrival, reach // 4, 3 * reach // 4)
        axes[name].set_title(f"{name}\nspeed, diagonal / axis: {ratio:.2f}")
    line_legend(figure, {"front": {"color": BLUE}, "circle": {"color": VERMILION, "linestyle": (0, (4, 2))}})
    return figure


def front(fire: Fire, reach: int, worlds: int) -> Tensor:
    """Return the mean ticks until each cell of level forest burned, float32 [2 reach + 3, 2 reach + 3]."""
    side, ticks = 2 * reach + 3, round(1.45 * reach) * fire.ticks_per_stage
    middle = (side // 2, side // 2)
    return point_fires(fire, (side, side), middle, ticks=ticks, worlds=worlds, radius=0).mean_arrival()


def _draw_front(axes: "Axes", arrival: Tensor, reach: int) -> None:
    """Draw the fronts at the times when they have come 10, 20, ... cells along the axes, and circles there."""
    from matplotlib.patches import Circle

    side = arrival.shape[0] * CELL / 1000.0
    middle = arrival.shape[0] // 2
    for distance in range(reach // 4, reach + 1, reach // 4):
        on_axes = [(middle + distance, middle), (middle - distance, middle), (middle, middle + distance)]
        time = torch.stack([arrival[place] for place in [*on_axes, (middle, middle - distance)]]).mean().item()
        contours(axes, arrival, levels=[time], colors=BLUE, linewidths=1.1)
        circle = Circle((side / 2.0, side / 2.0), distance * CELL / 1000.0, fill=False, linestyle=(0, (4, 2)))
        circle.set(edgecolor=VERMILION, linewidth=1.0)
        axes.add_patch(circle)
    axes.plot(side / 2.0, side / 2.0, marker="+", color=INK, markersize=5)
    axes.set(aspect="equal", xlim=(0.0, side), ylim=(0.0, side), xticks=[], yticks=[])
    scale_bar(axes, side)


def ellipses(speeds: tuple[float, ...] = (0.0, 2.5, 5.0, 7.5, 10.0), reach: int = 50, worlds: int = 24) -> "Figure":
    """Outlines of fires in the wind, and their length over breadth by its speed (ours).

    Calm hazard 0.05 a tick from each burning neighbour, which spreads for 30 ticks.
    """
    fires = {"ellipse": [fires_in_wind(speed, "ellipse", reach, worlds) for speed in speeds]}
    fires["alexandridis"] = [fires_in_wind(speed, "alexandridis", reach, worlds) for speed in speeds if speed > 0.0]
    figure, axes = sheet([["outlines", "ratio"]], (7.2, 3.3), "Fires in a uniform west wind", width_ratios=[1.3, 1.0])
    _draw_outlines(axes["outlines"], speeds, fires["ellipse"], reach)
    _draw_curve(axes["ratio"])
    for kernel, look in _KERNELS.items():
        ratios = [length_over_breadth(burned) for burned, _ in fires[kernel]]
        there = speeds[len(speeds) - len(ratios) :]
        axes["ratio"].plot(there, ratios, linestyle="none", markersize=5.5, label=f"kernel {kernel}", **look)
    axes["ratio"].legend(loc="upper left")
    return figure


def burned_by_wind(
    speeds: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0), ticks: int = 200, worlds: int = 16
) -> "Figure":
    """Area burned in the same time by the speed of the wind, for each of its factors (ours).

    Law hazard as it is by default, but for the kernel; of ``fbp`` in three bearings to the grid.
    """
    title = f"Area burned in {ticks} ticks of law hazard, over that in calm air"
    figure, axes = sheet([["area", "head"]], (8.6, 3.3), title)
    for name, (kernel, bearing, look) in _WINDS.items():
        fire = HazardFire(kernel=kernel)
        found = [burned_in_wind(fire, speed, bearing, ticks, worlds) for speed in speeds]
        for part, axis in zip(zip(*found), axes.values()):
            axis.plot(speeds, [each / part[0] for each in part], label=name, **look)
    axes["head"].plot(speeds, head_factor(torch.tensor(speeds), "C-7", 94.0), color=INK, label="Canadian system, C-7")
    for axis, name in zip(axes.values(), ("burned area", "distance of the head")):
        axis.set(xlabel="wind speed [m/s]", ylabel="over calm", title=name, yscale="log")
        axis.spines[["top", "right"]].set_visible(False)
    axes["head"].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


_WINDS = {
    "fbp, along the grid": ("fbp", 0.0, {"color": BLUE, "marker": "o"}),
    "fbp, at 22.5 degrees": ("fbp", 22.5, {"color": BLUE, "marker": "^", "linestyle": "--"}),
    "fbp, at 45 degrees": ("fbp", 45.0, {"color": BLUE, "marker": "s", "linestyle": ":"}),
    "ellipse, along the grid": ("ellipse", 0.0, {"color": VERMILION, "marker": "o"}),
    "alexandridis, along the grid": ("alexandridis", 0.0, {"color": PURPLE, "marker": "o"}),
}
_KERNELS = {"ellipse": {"color": BLUE, "marker": "o"}, "alexandridis": {"color": VERMILION, "marker": "s"}}


def _draw_outlines(
    axes: "Axes", speeds: tuple[float, ...], fires: list[tuple[Tensor, tuple[int, int]]], reach: int
) -> None:
    """Draw where each fire burns with probability 0.5, from one place of ignition."""
    colours = ramp("viridis_r", 0.15, 1.0)(np.linspace(0.0, 1.0, len(speeds)))
    for speed, (burned, lit), colour in zip(speeds, fires, colours):
        height, width = burned.shape
        east, north = (np.arange(width) - lit[1]) * CELL / 1000.0, (lit[0] - np.arange(height)) * CELL / 1000.0
        axes.contour(east, north, burned.numpy(), levels=[0.5], colors=[colour], linewidths=1.4)
        axes.plot([], [], color=colour, linewidth=1.4, label=f"{speed:g} m/s")
    axes.plot(0.0, 0.0, marker="+", color=INK, markersize=7)
    axes.set(aspect="equal", xlabel="downwind [km]", ylabel="across the wind [km]")
    axes.set_title(f"kernel ellipse, burn probability 0.5,\nwhen the head has come {reach * CELL / 1000.0:g} km")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), title="west wind", title_fontsize=7.5)


def _draw_curve(axes: "Axes") -> None:
    """Draw length over breadth by wind speed after the Canadian FBP System, and a band of 20 % about it."""
    speeds = torch.linspace(0.0, 10.5, 106)
    curve = length_to_breadth(speeds).numpy()
    axes.fill_between(speeds, 0.8 * curve, 1.2 * curve, color="#d8d8d8", linewidth=0.0, label="± 20 %")
    axes.plot(speeds, curve, color=INK, linewidth=1.2, label="Canadian FBP System")
    axes.set(xlim=(-0.4, 10.5), ylim=(0.0, None), xlabel="wind speed [m/s]", ylabel="length / breadth")
    axes.set_title("length over breadth of outlines")
    axes.spines[["top", "right"]].set_visible(False)


def fire_sizes(size: int = 128, trees_per_strike: int = 200, fires: int = 1000, discard: int = 300) -> "Figure":
    """Sizes of fires where lightning is rare and fires are short (ours; after Drossel and Schwabl 1992)."""
    sizes, state = strike_and_burn(size, trees_per_strike, fires, discard=discard)
    smallest, largest = 10, 5 * trees_per_strike
    exponent, error = fitted_exponent(sizes, smallest, largest)
    title = f"Rare lightning, short fires: {trees_per_strike} trials to grow a tree between two fires"
    figure, axes = sheet([["forest", "sizes"]], (7.2, 3.75), title)
    show_map(axes["forest"], fire_image(state))
    axes["forest"].set_title("the forest at the end, with its last fire")
    fire_legend(figure)
    _draw_sizes(axes["sizes"], sizes, exponent, error, (smallest, largest))
    return figure


def _draw_sizes(axes: "Axes", sizes: Tensor, exponent: float, error: float, fitted: tuple[int, int]) -> None:
    """Draw the density of fire sizes in bins of equal ratio, and the power law fitted between two sizes."""
    edges = np.unique(np.round(np.geomspace(1.0, float(sizes.max()) + 1.0, 22)))
    counts, _ = np.histogram(sizes.numpy(), edges)
    density, middle = counts / np.diff(edges) / len(sizes), np.sqrt(edges[:-1] * (edges[1:] - 1.0).clip(1.0))
    spread = density / np.sqrt(counts.clip(1))
    some = counts > 0
    axes.errorbar(
        middle[some], density[some], spread[some], fmt="o", color=BLUE, markersize=4, linewidth=0.9,
        label=f"{len(sizes)} fires",
    )  # fmt: skip
    ends = np.array(fitted, dtype=float)
    share = ((sizes >= fitted[0]) & (sizes <= fitted[1])).float().mean().item()
    law = share * ends**-exponent / (np.arange(fitted[0], fitted[1] + 1.0) ** -exponent).sum()
    name = f"$s^{{-{exponent:.2f}}}$, fitted from {fitted[0]} to {fitted[1]} trees\n(standard error {error:.2f})"
    axes.plot(ends, law, color=VERMILION, linewidth=1.5, label=name)
    axes.set(xscale="log", yscale="log", xlabel="trees burned by a fire, s", ylabel="probability density")
    axes.set_title("how many trees a fire burns")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="lower left")
