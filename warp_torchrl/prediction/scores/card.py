"""Card of a fire on one page: maps of hits and misses, area over time, reliability, and a table of scores."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import (
    BLUE,
    INK,
    SOFT,
    VERMILION,
    contours,
    line_legend,
    ramp,
    save_figure,
    sheet,
    show_map,
    style,
)
from warp_torchrl.prediction.scores.cells import BURNS
from warp_torchrl.prediction.scores.predicted import Predicted
from warp_torchrl.prediction.scores.probabilities import interval
from warp_torchrl.prediction.scores.report import hours_of, prediction_cells
from warp_torchrl.prediction.scores.seen import Seen
from warp_torchrl.system import disk
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.window import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BOTH, _MISSED, _FALSE = "#8c8c8c", BLUE, VERMILION
_WIDTH, _HIGHEST = 10.5, 4.5  # of the card, and of its maps [inches]
_MAPS = 3  # of hits and misses
_MARGIN = 0.04  # about the fire, of the map's longer side
_COLUMNS = {
    "hours": 0, "seen [ha]": 1, "predicted [ha]": 3, "5 to 95 % [ha]": 4, "area": 5, "Jaccard": 6, "Sorensen": 7,
    "kappa": 8, "growth: Jaccard": 9, "growth: F1": 10, "Brier": 11, "CRPS [min]": 12,
}  # fmt: skip
_TIMES = 60  # of the curve of areas


def write_card(path: Path, predicted: Predicted, seen: Sequence[Seen], numbers: Mapping[str, Any]) -> None:
    """Draw the card of a fire.

    Args:
        path: PNG.
        predicted: The fire.
        seen: What had burned.
        numbers: Its scores, from ``report.score_numbers``.

    Raises:
        ImportError: If Matplotlib is not installed.
        OSError: If the write fails, with the path.
    """
    shown = _some(len(seen))
    window = _window(predicted, seen)
    maps = [f"map {number}" for number in shown]
    panels = [*maps, "chance"]
    layout = [[name for name in panels for _ in range(12 // len(panels))]]
    layout += [["area"] * 6 + ["reliability"] * 6, ["table"] * 12]
    rows = len(numbers["observations"]) + 5
    height = min(_HIGHEST, (_WIDTH / len(panels) - 0.3) * window.height / window.width)
    sizes = [height + 0.6, 2.3, 0.2 * rows]
    with disk.with_path(path), style():
        figure, axes = sheet(layout, (_WIDTH, sum(sizes) + 1.0), numbers["title"], height_ratios=sizes)
        for name, number in zip(maps, shown, strict=True):
            is_last = number == len(seen) - 1
            _hits(axes[name], predicted, seen[number], window, is_last)
            axes[name].set_title(_title(numbers["observations"][number]))
        _chance(axes["chance"], predicted, seen[-1], window)
        for name in panels:
            axes[name].set_anchor("N")  # one has a colour bar below
        _areas(axes["area"], predicted, seen, numbers)
        _reliability(axes["reliability"], predicted, numbers)
        _table(axes["table"], numbers)
        square = {"marker": "s", "linestyle": "none", "markersize": 7}
        line_legend(
            figure,
            {
                "burned and predicted": {**square, "color": _BOTH},
                "burned, not predicted": {**square, "color": _MISSED},
                "predicted, not burned": {**square, "color": _FALSE},
            },
        )
        save_figure(figure, path)


def _some(count: int) -> list[int]:
    """Return which observations are mapped: the last, and evenly chosen ones before."""
    places = np.linspace(0, count - 1, min(count, _MAPS)).round().astype(int)
    return sorted({int(each) for each in places})


def _title(row: Mapping[str, Any]) -> str:
    when = "at the end" if row["minutes"] is None else f"{hours_of(row)} h"
    return f"{when}: Jaccard {row['forecast']['jaccard']:.2f}, kappa {row['forecast']['kappa']:.2f}"


def _window(predicted: Predicted, seen: Sequence[Seen]) -> Window:
    """Return the part of the map that has the fires that were seen, and the predicted ones by then."""
    cells = seen[-1].burned | (predicted.chance(seen[-1].minutes, True) >= BURNS)
    height, width = cells.shape
    rows, columns = (torch.nonzero(cells.any(axis)).flatten() for axis in (1, 0))
    if not len(rows):
        return Window.whole((height, width))
    margin = max(2, round(_MARGIN * max(height, width)))
    top, left = max(0, int(rows[0]) - margin), max(0, int(columns[0]) - margin)
    bottom, right = min(height, int(rows[-1]) + margin + 1), min(width, int(columns[-1]) + margin + 1)
    return Window(top, left, bottom - top, right - left, (height, width))


def _cut(plane: Tensor, window: Window) -> Tensor:
    return plane[window.top : window.top + window.height, window.left : window.left + window.width]


def _hits(axes: "Axes", predicted: Predicted, seen: Seen, window: Window, is_last: bool) -> None:
    from matplotlib.colors import to_rgb

    burned = _cut(seen.burned, window).numpy()
    told = _cut(predicted.chance(seen.minutes, is_last) >= BURNS, window).numpy()
    image = np.ones((*burned.shape, 3))
    for cells, colour in ((burned & told, _BOTH), (burned & ~told, _MISSED), (told & ~burned, _FALSE)):
        image[cells] = to_rgb(colour)
    show_map(axes, image, predicted.grid.cell_size)


def _chance(axes: "Axes", predicted: Predicted, last: Seen, window: Window) -> None:
    """Map the burn probability of an ensemble, or the times of arrival of one fire, with the outline of what burned."""
    if predicted.is_ensemble or predicted.arrival is None:
        values, label, top = _cut(predicted.chance(last.minutes, True), window).clone(), "burn probability", 1.0
        values[values == 0.0] = torch.nan
    else:
        values = _cut(predicted.arrival[0], window) / 60.0
        values = torch.where(values * 60.0 <= min(last.minutes, NEVER / 2), values, torch.nan)
        label, top = "hours of arrival", None
    image = show_map(axes, values, predicted.grid.cell_size, cmap=ramp("viridis_r", 0.05, 1.0), vmin=0.0, vmax=top)
    burned = _cut(last.burned, window)
    if bool(burned.any()) and not bool(burned.all()):
        contours(axes, burned.float(), predicted.grid.cell_size, levels=[0.5], colors=INK, linewidths=0.8)
    axes.figure.colorbar(image, ax=axes, location="bottom", shrink=0.8, pad=0.02)
    axes.set_title(f"{label}; line: what burned")


def _areas(axes: "Axes", predicted: Predicted, seen: Sequence[Seen], numbers: Mapping[str, Any]) -> None:
    rows = [row for row in numbers["observations"] if row["minutes"] is not None]
    axes.set(title="area [ha]", xlabel="hours since the start")
    if not rows or predicted.arrival is None:
        for row in numbers["observations"]:
            axes.bar(["seen", "predicted"], [row["seen_ha"], row["predicted_ha"]], color=[INK, VERMILION])
        axes.set(xlabel="")
        return
    times = np.linspace(0.0, max(row["minutes"] for row in rows), _TIMES)
    areas = torch.stack([predicted.areas(float(time)) for time in times])  # type: ignore[misc]
    if areas.shape[1] > 1:
        low, high = np.array([interval(each) for each in areas]).T
        axes.fill_between(times / 60.0, low, high, color=VERMILION, alpha=0.2, label="5 to 95 % of the fires")
    axes.plot(
        times / 60.0,
        areas.median(1).values,
        color=VERMILION,
        label="predicted, the median fire" if areas.shape[1] > 1 else "predicted",
    )
    axes.plot([row["minutes"] / 60.0 for row in rows], [row["seen_ha"] for row in rows], "o", color=INK, label="seen")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper left")


def _reliability(axes: "Axes", predicted: Predicted, numbers: Mapping[str, Any]) -> None:
    if not predicted.is_ensemble:
        _shapes(axes, numbers)
        return
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=0.8)
    bins = [row for row in numbers["reliability"] if row[2]]
    most = max(row[2] for row in bins)
    axes.plot([row[0] for row in bins], [row[1] for row in bins], color=VERMILION)
    sizes = [10.0 + 90.0 * row[2] / most for row in bins]
    axes.scatter([row[0] for row in bins], [row[1] for row in bins], s=sizes, color=VERMILION)
    axes.set(
        title="reliability at the last observation, whole fire; size: cells",
        xlabel="burn probability",
        ylabel="share that burned",
    )


def _shapes(axes: "Axes", numbers: Mapping[str, Any]) -> None:
    """Draw the Jaccard index at the area beside the null models."""
    found = {name: each["jaccard_at_area"] for name, each in numbers["at_area"].items()}
    axes.barh(
        list(found),
        list(found.values()),
        height=0.5,
        color=[VERMILION if name == "predicted" else SOFT for name in found],
    )
    axes.set(title="Jaccard index at the area last seen", xlim=(0.0, 1.0), ylim=(-0.7, max(3, len(found)) - 0.3))
    axes.invert_yaxis()


def _table(axes: "Axes", numbers: Mapping[str, Any]) -> None:
    cells = [prediction_cells(row) for row in numbers["observations"]]
    rows = [[row[at] for at in _COLUMNS.values()] for row in cells]
    axes.axis("off")
    drawn = axes.table(rows, colLabels=list(_COLUMNS), loc="upper center", cellLoc="center", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7.0)
    drawn.auto_set_column_width(list(range(len(_COLUMNS))))
    others = [f"{name} {each['jaccard_at_area']:.2f}" for name, each in numbers["at_area"].items()]
    text = [f"Jaccard at the area last seen: {', '.join(others)}."] if others else []
    text.append(f"Brier score over the whole fire: {numbers['brier']:.2f}.")
    if numbers["arrival"] is not None:
        error = numbers["arrival"]
        text.append(f"Arrival: bias {error['bias']:+.0f} min, mean absolute error {error['mean_absolute']:.0f} min.")
    line = axes.text(0.0, 0.0, "\n".join(text), transform=axes.transAxes, fontsize=7.5, va="bottom")
    line.set_in_layout(False)
