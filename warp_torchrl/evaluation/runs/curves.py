"""Learning curves of runs, from their ``metrics.csv``: the curves of the WARP-CA paper, and the forest saved, or
another goal.

Runs that differ in their seed only are one line, their mean, with a band from minimum to maximum. Values are not
smoothed; files of many rows are averaged over bins, and the figure says so.
"""

import math
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_torchrl.env.pictures.drawing import SOFT, line_style, sheet
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.runs.folders import FRAMES, MOST_ROWS, SECONDS, Run, read_run, run_folders
from warp_torchrl.evaluation.units import FORMS, on_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_KL, _CLIP_FRACTION, _ENTROPY = "train/approx_kl", "train/clip_fraction", "train/entropy_loss"
_EXPLAINED, _POLICY, _VALUE = "train/explained_variance", "train/policy_gradient_loss", "train/value_loss"
_LENGTH, _REWARD = "rollout/ep_len_mean", "rollout/ep_rew_mean"
_LABELS = {
    "time/fps": "frames per second [1/s]",
    "train/loss": "loss",
    _KL: "approximate KL [nat]",
    _VALUE: "value loss",
    _ENTROPY: "entropy loss",
    _LENGTH: "episode length [steps]",
    _REWARD: "episode reward",
    _CLIP_FRACTION: "clip fraction",
    "train/clip_range": "clip range",
    _EXPLAINED: "explained variance",
    _POLICY: "policy-gradient loss",
}
SINGLE = (
    ("time/fps", "train/loss", _KL, _VALUE, _ENTROPY),
    (_LENGTH, _REWARD, _CLIP_FRACTION, _EXPLAINED, _POLICY),
)
"""Columns of ``metrics.csv`` that are drawn of one agent, as panels in rows."""
MULTI = (
    ("time/fps", _KL, _CLIP_FRACTION),
    ("train/clip_range", _ENTROPY, _EXPLAINED),
    ("train/loss", _POLICY, _VALUE),
)
"""Columns of ``metrics.csv`` that are drawn of several agents, as panels in rows."""


class Line(NamedTuple):
    """Runs that differ in their seed only, and their style."""

    label: str
    look: dict[str, Any]
    runs: list[Run]


def lines_of(paths: Sequence[Path | tuple[str, Path]]) -> list[Line]:
    """Return the lines of runs.

    Args:
        paths: Run folders, and folders of a sweep, whose every run is taken; some with what to call their runs.

    Raises:
        ValueError: If a folder is missing or without runs, or a file is not what a run writes.
        OSError: If a file cannot be read.
    """
    named = [each if isinstance(each, tuple) else ("", each) for each in paths]
    found: dict[Path, tuple[str, Path]] = {}
    for name, path in named:
        for folder in run_folders([path]):
            found.setdefault(folder.resolve(), (name, folder))
    return grouped_lines([replace(read_run(folder), called=name) for name, folder in found.values()])


def curve_figures(lines: Sequence[Line]) -> dict[str, Callable[[], "Figure"]]:
    """Return a function for each figure of the runs, by name."""
    single = [line for line in lines if line.runs[0].n_agents == 1]
    multi = [line for line in lines if line.runs[0].n_agents != 1]
    drawn = {"curves_saved": partial(saved_curves, lines)}
    if single:
        drawn["curves_single"] = partial(learning_curves, single, SINGLE, "Learning curves of one agent")
    if multi:
        drawn["curves_multi"] = partial(learning_curves, multi, MULTI, "Learning curves of several agents")
    return dict(sorted(drawn.items()))


# Averaging


def band(runs: Sequence[Run], x: str, y: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Return a column's mean over runs, its minimum and its maximum, by another column.

    Each run is interpolated linearly between its rows at the places of all runs, within the range that all of them
    cover.

    Returns:
        (places, mean, minimum, maximum), [n] each; None where the runs share no range.
    """
    paths = []
    for run in runs:
        across, values = (run.columns.get(name, np.full_like(run.columns[FRAMES], math.nan)) for name in (x, y))
        there = np.isfinite(across) & np.isfinite(values)
        if there.any():
            paths.append((across[there], values[there]))
    if not paths:
        return None
    places = np.unique(np.concatenate([across for across, _ in paths]))
    shared = max(across[0] for across, _ in paths), min(across[-1] for across, _ in paths)
    places = places[(places >= shared[0]) & (places <= shared[1])]
    values = np.stack([np.interp(places, *path) for path in paths])
    return (places, values.mean(axis=0), values.min(axis=0), values.max(axis=0)) if places.size else None


def grouped_lines(runs: Sequence[Run]) -> list[Line]:
    """Return the lines to draw: runs that differ in their seed alone together, named by what differs among all.

    Runs that are called something have that name.
    """
    found: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        found.setdefault((run.called, run.alike), []).append(run)
    recorded = [run.names for run in runs if len(run.names) > 1]
    shown = [place for place, names in enumerate(zip(*recorded)) if place == 0 or len(set(names)) > 1]
    names = [alike[0].called or _name(alike[0].names, shown) for alike in found.values()]
    count = Counter(names)
    seen: Counter[tuple[str, ...]] = Counter()
    lines, looks, scenarios = [], _Places(), _Places()
    for name, alike in zip(names, found.values()):
        run = alike[0]
        seen[run.names] += 1
        look = _look(looks.of((run.names[:-1] or run.names, seen[run.names])), scenarios.of(run.scenario))
        lines.append(Line((f"{name} {run.mark}" if count[name] > 1 else name) + _how_many(alike), look, alike))
    return lines


class _Places(dict[Hashable, int]):
    """Assigns consecutive numbers to keys on first use."""

    def of(self, thing: Hashable) -> int:
        """Return the number of a key."""
        return self.setdefault(thing, len(self))


def _name(names: tuple[str, ...], shown: Sequence[int]) -> str:
    return names[0] if len(names) == 1 else " ".join(names[place] for place in shown)


def _how_many(runs: Sequence[Run]) -> str:
    if len(runs) == 1:
        return ""
    seeds = {run.seed for run in runs}
    return f" ({len(runs)} {'seeds' if len(seeds) == len(runs) else 'runs'})"


# Drawing

_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), (0, (3, 1.2, 1, 1.2, 1, 1.2)))


def _look(learner: int, scenario: int) -> dict[str, Any]:
    """Return a line's style: colour and dashes by learner, distinct in grey, and width by scenario."""
    dashes = _DASHES[learner % len(_DASHES)]
    return {"color": line_style(learner)["color"], "linestyle": dashes, "linewidth": 1.1 + 0.6 * scenario}


def learning_curves(lines: Sequence[Line], panels: Sequence[Sequence[str]], title: str) -> "Figure":
    """Draw columns of ``metrics.csv`` over world steps, a panel each.

    Args:
        lines: What to draw.
        panels: The columns, in rows.
        title: What is seen.
    """
    scenarios = {line.runs[0].scenario for line in lines}
    title = f"{title}, scenario {_plain(*scenarios)}" if len(scenarios) == 1 else title
    figure, axes = _sheet(panels, (2.2 * len(panels[0]) + 0.2, 1.75 * len(panels) + 0.6), title, lines)
    factor, unit = _steps(lines)
    for column in _LABELS.keys() & axes.keys():
        _draw_panel(axes[column], lines, (FRAMES, factor), (column, 1.0))
        axes[column].set_ylabel(_LABELS[column])
    for column in panels[-1]:
        axes[column].set_xlabel(unit)
    figure.align_ylabels()
    return figure


def saved_curves(lines: Sequence[Line]) -> "Figure":
    """Draw what policies are compared by, in training, by scenario, over world steps and over minutes."""
    scenarios = list(dict.fromkeys(line.runs[0].scenario for line in lines))
    panels = [[f"{scenario} {x}" for x in (FRAMES, SECONDS)] for scenario in scenarios]
    goals = {line.runs[0].goal for line in lines}
    title = "Goals in training" if goals != {SAVED} else "Forest saved in training"
    figure, axes = _sheet(panels, (7.2, 2.1 * len(panels) + 0.8), title, lines)
    for scenario, (left, right) in zip(scenarios, panels):
        there = [line for line in lines if line.runs[0].scenario == scenario]
        factor, unit = _steps(there)
        goal = there[0].runs[0].goal
        drawn = f"world/{goal.name}", FORMS[goal.unit].factor
        _draw_panel(axes[left], there, (FRAMES, factor), drawn)
        _draw_panel(axes[right], there, (SECONDS, 1.0 / 60.0), drawn)
        axes[left].set(ylabel=on_axis(goal), title=f"scenario {_plain(scenario)}", xlabel=unit)
        axes[right].set(ylabel=on_axis(goal), title=f"scenario {_plain(scenario)}", xlabel="time [min]")
    return figure


def _sheet(
    panels: Sequence[Sequence[str]], size: tuple[float, float], title: str, lines: Sequence[Line]
) -> tuple["Figure", dict[str, "Axes"]]:
    """Return a figure with title, caption and legend, and its axes."""
    from matplotlib.lines import Line2D

    columns, title = _legend_columns(lines, size[0]), title + _caption(lines)
    height = size[1] + 0.17 * (math.ceil(len(lines) / columns) + title.count("\n"))
    figure, axes = sheet([list(row) for row in panels], (size[0], height), title)
    handles = [Line2D([], [], label=_plain(line.label), **line.look) for line in lines]
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=3.2)
    return figure, axes


def _draw_panel(axes: "Axes", lines: Sequence[Line], x: tuple[str, float], y: tuple[str, float]) -> None:
    """Draw a column over another one, each times a factor."""
    from matplotlib.ticker import MaxNLocator

    bands = [(line.look, len(line.runs), band(line.runs, x[0], y[0])) for line in lines]
    axes.spines[["top", "right"]].set_visible(False)
    if all(found is None for _, _, found in bands):
        axes.set(xticks=[], yticks=[])
        axes.text(0.5, 0.5, "no values", transform=axes.transAxes, ha="center", va="center", color=SOFT)
        return
    for look, several, found in bands:
        if found is None:
            continue
        places, mean, low, high = found[0] * x[1], *(values * y[1] for values in found[1:])
        axes.plot(places, mean, marker="." if len(places) == 1 else "", **look)
        if several > 1:
            axes.fill_between(places, low, high, color=look["color"], alpha=0.2, linewidth=0.0)
    reached = [band(line.runs, x[0], x[0]) for line in lines]  # the same in every panel, whatever has values there
    axes.set_xlim(0.0, x[1] * max(found[0][-1] for found in reached if found is not None))
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.ticklabel_format(useOffset=False, scilimits=(-3, 5))


def _steps(lines: Sequence[Line]) -> tuple[float, str]:
    """Return the factor and the label of an axis of world steps."""
    longest = max(run.columns[FRAMES][-1] for line in lines for run in line.runs)
    if longest < 2_000:
        return 1.0, "world steps"
    return (1e-3, "world steps [thousand]") if longest < 1_000_000 else (1e-6, "world steps [million]")


def _caption(lines: Sequence[Line]) -> str:
    """Return the caption's notes on averaged seeds and averaged rows."""
    longest = max(run.rows_per_bin for line in lines for run in line.runs)
    several = any(len(line.runs) > 1 for line in lines)
    seeds = "\nmean over seeds in a band from minimum to maximum, as far as all of them reach" if several else ""
    bins = f"\nfiles of more than {MOST_ROWS} rows as means over bins, of up to {longest} rows" if longest > 1 else ""
    return seeds + bins


def _legend_columns(lines: Sequence[Line], width: float) -> int:
    """Return how many columns of a legend fit on a sheet of this width [inches]."""
    widest = 0.65 + 0.058 * max(len(_plain(line.label)) for line in lines)  # a handle, and letters of a legend's size
    return max(1, min(len(lines), int(width / widest)))


def _plain(label: str) -> str:
    """Return a label that Matplotlib shows unchanged: no mathematics, not hidden, and not too long."""
    short = label if len(label) <= 60 else f"{label[:57]}..."
    return (" " if short.startswith("_") else "") + short.replace("$", r"\$")
