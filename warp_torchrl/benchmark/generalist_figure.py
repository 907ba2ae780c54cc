"""Figure of a policy on every kind of fire, beside its rival on each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warp_torchrl.env.pictures.drawing import BLUE, GRID, ORANGE, SOFT, save_figure, sheet, style

_DRAWN = {"policy": ("policy", BLUE, -0.15), "beside": ("rival, named on the right", ORANGE, 0.15)}
"""Label, colour and offset [rows] of what is drawn of a row."""


def draw_generalist(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the trees saved by the policy and its rival for each kind of fire, with 95 % intervals.

    Args:
        rows: What ``generalise`` yields.
        path: PNG to write.
    """
    with style():
        title = f"Trees saved, {rows[0]['episodes']} fires each, with 95 % intervals"
        figure, axes = sheet([["saved"]], (6.2, 1.1 + 0.2 * len(rows)), title)
        panel = axes["saved"]
        panel.grid(color=GRID, linewidth=0.5, axis="x")
        panel.set_axisbelow(True)
        for key, (label, colour, offset) in _DRAWN.items():
            means = [100 * row[key]["mean"] for row in rows]
            ends = [
                [abs(100 * row[key]["ci95"][end] - mean) for row, mean in zip(rows, means, strict=True)]
                for end in (0, 1)
            ]
            panel.errorbar(
                means,
                [place + offset for place in range(len(rows))],
                xerr=ends,
                fmt="o",
                color=colour,
                markersize=3.0,
                linewidth=1.2,
                label=label,
            )
        for place, row in enumerate(rows):
            beside = {"textcoords": "offset points", "va": "center", "fontsize": 7.0, "color": SOFT}
            panel.annotate(row["rival"], (1.0, place), (4, 0), xycoords=("axes fraction", "data"), **beside)
        panel.set_yticks(range(len(rows)), [row["place"] for row in rows])
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.set_xlabel("trees saved [%]")
        figure.legend(loc="outside lower center", ncols=2)
        save_figure(figure, path)
