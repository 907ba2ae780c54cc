"""World steps and time until runs first save a share of their training worlds' forest."""

from collections.abc import Sequence

import numpy as np

from warp_torchrl.evaluation.runs.curves import Line
from warp_torchrl.evaluation.runs.folders import FRAMES, SAVED, SECONDS, Run
from warp_torchrl.evaluation.runs.markdown import markdown

REACHED_WINDOW = 0.05
"""Share of a run's world steps over which batches are averaged, half before and half after each."""


def first_reached(run: Run, level: float) -> tuple[float, float] | None:
    """Return the world steps and the seconds after which a run saves a share; None where it never does.

    Args:
        run: With ``world/saved`` and times of each batch. Batches in which no episode ended have no share, and those of
            the first half of a window do not count.
        level: Share of the initial trees, of the mean over the batches about one.
    """
    frames, seconds = run.columns[FRAMES], run.columns.get(SECONDS)
    saved = run.columns.get(SAVED, np.full_like(frames, np.nan))
    if seconds is None:
        return None
    width = 0.5 * REACHED_WINDOW * frames[-1]
    counts = np.isfinite(saved) & (frames > width)  # the episodes that end before are the short ones
    for now, clock in zip(frames[counts], seconds[counts], strict=True):
        if saved[counts & (np.abs(frames - now) <= width)].mean() >= level:
            return float(now), float(clock)
    return None


def reached_table(lines: Sequence[Line], levels: Sequence[float]) -> str:
    """Return a Markdown table, a row for each line and a column for each level [%]: thousands of world steps, seconds.

    Several runs have the lowest and the highest of each.
    """
    rows = []
    for line in lines:
        found = [[first_reached(run, level / 100.0) for run in line.runs] for level in levels]
        rows.append([line.label, *map(_cell, found)])
    return markdown(["runs", *(f"to {level:g} %" for level in levels)], rows)


def _cell(found: Sequence[tuple[float, float] | None]) -> str:
    there = [each for each in found if each is not None]
    if not there:
        return "never"
    steps, seconds = ([each[place] for each in there] for place in (0, 1))
    missing = f", {len(found) - len(there)} never" if len(there) < len(found) else ""
    return f"{_range([each / 1000.0 for each in steps])} k, {_range(seconds)} s{missing}"


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} .. {high:.0f}"
