"""Figure of the cost of a step by worlds, agents and cells."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_torchrl.env.pictures.drawing import BLUE, GRID, INK, SOFT, VERMILION, save_figure, sheet, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SWEEPS = {"worlds": "worlds", "agents": "agents in a world", "cells": "cells in a world"}


def draw_growth(rows: list[dict[str, Any]], path: Path, processor: str) -> None:
    """Draw milliseconds a step and agent steps a second against worlds, agents and cells.

    Args:
        rows: What ``growth`` returned.
        path: PNG to write.
        processor: Name of the processor and its threads, for the title.
    """
    layout = [[f"{measure} {varies}" for varies in _SWEEPS] for measure in ("time", "rate")]
    with style():
        figure, axes = sheet(layout, (7.6, 4.6), f"A step of the environment, {processor}")
        for varies, label in _SWEEPS.items():
            sweep = [row for row in rows if row["varies"] == varies]
            _draw_sweep(axes[f"time {varies}"], sweep, varies, "ms_per_step", BLUE)
            _draw_sweep(axes[f"rate {varies}"], sweep, varies, "agent_steps_per_second", VERMILION)
            axes[f"rate {varies}"].set_xlabel(label)
            axes[f"time {varies}"].set_title(_fixed(sweep[-1], varies))
        for measure, label in (("time", "ms a step"), ("rate", "agent steps/s")):
            row = [axes[f"{measure} {varies}"] for varies in _SWEEPS]
            row[0].set_ylabel(label)
            _share_y(row)
        save_figure(figure, path)


def _draw_sweep(axes: "Axes", sweep: list[dict[str, Any]], varies: str, measure: str, colour: str) -> None:
    """Draw one measure against what varies; of times also the lowest and highest, and a line of slope 1."""
    sizes, values = [row[varies] for row in sweep], [row[measure] for row in sweep]
    axes.set(xscale="log", yscale="log")
    axes.grid(color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:,g}")
    if measure == "ms_per_step":
        low, high = ([row[bound] for row in sweep] for bound in ("lowest", "highest"))
        axes.fill_between(sizes, low, high, color=colour, alpha=0.18, linewidth=0.0)
        _draw_proportion(axes, sizes, values)
    axes.plot(sizes, values, color=colour, linewidth=1.4, marker="o", markersize=3.5)
    axes.set_xticks(sizes, [row["size"].replace(" ", "") if varies == "cells" else str(row[varies]) for row in sweep])
    for end, beside, side in ((0, 1, "left"), (-1, -2, "right")):
        is_above = values[beside] <= 1.2 * values[end]  # away from the curve
        shift = (-4 if end == 0 else 4, 5 if is_above else -12)
        place = sizes[end], values[end]
        axes.annotate(_short(values[end]), place, shift, textcoords="offset points", ha=side, fontsize=7.0, color=INK)


def _draw_proportion(axes: "Axes", sizes: list[float], values: list[float]) -> None:
    """Draw the line on which the last value would lie if all were proportional, as far down as half the lowest."""
    first = max(sizes[0], 0.5 * min(values) * sizes[-1] / values[-1])
    start = values[-1] * first / sizes[-1]
    axes.plot([first, sizes[-1]], [start, values[-1]], color=SOFT, linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
    axes.annotate(
        "proportional", (first, start), (5, -1), textcoords="offset points", ha="left", va="center", fontsize=7.0,
        color=SOFT,
    )  # fmt: skip


def _share_y(row: list["Axes"]) -> None:
    """Give a row of axes the same range, with room for the numbers at the ends."""
    low, high = min(axes.get_ylim()[0] for axes in row), max(axes.get_ylim()[1] for axes in row)
    for axes in row:
        axes.set_ylim(low / (high / low) ** 0.1, high * (high / low) ** 0.1)


def _fixed(row: dict[str, Any], varies: str) -> str:
    """Return the constant numbers of a sweep."""
    parts = {
        "worlds": f"{row['worlds']} worlds",
        "agents": f"{row['agents']} agents",
        "cells": row["size"],
    }
    return ", ".join(part for name, part in parts.items() if name != varies)


def _short(value: float) -> str:
    return f"{value / 1000.0:,.0f} k" if value >= 10_000.0 else f"{value:,.0f}" if value >= 10.0 else f"{value:.1f}"
