"""Forest saved by runs in training, by world steps, and their speed."""

from collections.abc import Sequence

import numpy as np

from warp_torchrl.evaluation.runs.curves import Line
from warp_torchrl.evaluation.runs.folders import FPS, FRAMES, SAVED, SECONDS, Run
from warp_torchrl.evaluation.runs.markdown import markdown

SAVED_WINDOW = 0.05
"""Share of a run's world steps over which batches are averaged, all of it before the step that is asked for."""


def saved_at(run: Run, step: float) -> float:
    """Return the share of the forest saved in training by a world step: the mean over the twentieth of the run before.

    Args:
        run: With ``world/saved`` of each batch. Batches in which no episode ended have no share, and do not count.
        step: World step s: batches that end in (s - a twentieth of the run's steps, s] count.

    Returns:
        Mean share of the initial trees; NaN where no batch counts.

    Raises:
        ValueError: If the run has no ``world/saved``, or ends before the step.
    """
    frames, end = run.rows[FRAMES], run.rows[FRAMES][-1]
    if SAVED not in run.rows:
        raise ValueError(f"{run.folder / 'metrics.csv'} has no column {SAVED}")
    if step > end:
        raise ValueError(f"at must be within the run, {end:.0f} world steps of {run.folder}, got {step:.0f}")
    counts = (frames > step - SAVED_WINDOW * end) & (frames <= step) & np.isfinite(run.rows[SAVED])
    return float(run.rows[SAVED][counts].mean()) if counts.any() else np.nan


def speed(run: Run) -> float:
    """Return the median of ``time/fps``, world steps a second; NaN where none is recorded."""
    found = run.rows.get(FPS, np.empty(0))
    found = found[np.isfinite(found)]
    return float(np.median(found)) if found.size else np.nan


def minutes(run: Run) -> float:
    """Return the minutes from the start of training to its last batch; NaN where they are not recorded."""
    found = run.rows.get(SECONDS, np.empty(0))
    return float(found[-1]) / 60.0 if found.size else np.nan


def saved_table(lines: Sequence[Line], steps: Sequence[float]) -> str:
    """Return a Markdown table, a row for each line: its forest saved [%] by world steps, its world steps a second, and
    the minutes that it took.

    Runs that differ in their seed alone have their mean, and the lowest and the highest.

    Raises:
        ValueError: If a run has no ``world/saved``, or ends before one of the steps.
    """
    rows = []
    for line in lines:
        shares = [[100.0 * saved_at(run, step) for run in line.runs] for step in steps]
        speeds, took = [speed(run) for run in line.runs], [minutes(run) for run in line.runs]
        rows.append([line.label, *(_cell(each, 1) for each in shares), _cell(speeds, 0), _cell(took, 1)])
    heading = ["saved in training, %", *(f"{step / 1000:g} k" for step in steps), "steps/s", "minutes"]
    return markdown(heading, rows)


def _cell(values: Sequence[float], digits: int) -> str:
    """Return the mean of what is there, with the lowest and the highest of several."""
    there = [value for value in values if np.isfinite(value)]
    if not there:
        return "-"
    low, mean, high = (f"{value:.{digits}f}" for value in (min(there), float(np.mean(there)), max(there)))
    return mean if len(values) == 1 else f"{mean} ({low} .. {high})"
