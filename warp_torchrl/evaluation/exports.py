"""Results of many runs for marl-eval and rliable, and curves over seeds with intervals.

Curves are of what a scenario's policies are compared by, its goal: of the evaluations on the way, ``evaluation/saved``
in ``metrics.csv``; of runs without those, of training, ``world/saved``.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.env.pictures.drawing import line_style
from warp_torchrl.evaluation.rows import SummaryRow
from warp_torchrl.evaluation.runs.folders import FRAMES, read_metrics
from warp_torchrl.evaluation.statistics import interval
from warp_torchrl.evaluation.units import FORMS, on_axis, sign_of
from warp_torchrl.system import disk

ENVIRONMENT = "warp_torchrl"


def curves(entry: SummaryRow) -> tuple[np.ndarray, np.ndarray]:
    """Return the goal over training, at the steps that all of a policy's runs have.

    Returns:
        World steps, int64 [n], and values, float64 [runs, n]; n is 0 where a run has no ``metrics.csv``.

    Raises:
        ValueError: If a ``metrics.csv`` is malformed.
        OSError: If one cannot be read.
    """
    paths = [folder / "metrics.csv" for folder in entry.folders]
    if not paths or not all(path.exists() for path in paths):
        return np.empty(0, np.int64), np.empty((len(entry.value), 0))
    tables = [read_metrics(path) for path in paths]
    evaluated, trained = (f"{part}/{entry.goal.name}" for part in ("evaluation", "world"))
    is_evaluated = all(np.isfinite(table.get(evaluated, np.full(1, np.nan))).any() for table in tables)
    values = [_by_step(table, evaluated if is_evaluated else trained) for table in tables]
    steps = sorted(set.intersection(*(set(each) for each in values)))
    return np.array(steps, np.int64), np.array([[each[step] for step in steps] for each in values])


def _by_step(table: dict[str, np.ndarray], column: str) -> dict[int, float]:
    values = table.get(column, np.full_like(table[FRAMES], np.nan))
    return {int(step): float(value) for step, value in zip(table[FRAMES], values, strict=True) if np.isfinite(value)}


def marl_eval(entries: Sequence[SummaryRow]) -> dict[str, Any]:
    """Return results as marl-eval reads them (Gorsane et al. 2022): by environment, task, algorithm and run.

    Each run has its steps, and the episodes of its last evaluation as ``absolute_metrics``. Algorithms of a task have
    the steps that all of its trainings have; a baseline has the same values at each of them.
    """
    tasks: dict[str, Any] = {}
    for scenario in dict.fromkeys(entry.scenario for entry in entries):
        group = [entry for entry in entries if entry.scenario == scenario]
        found = [curves(entry) for entry in group]
        shared = _shared_steps(found)
        tasks[scenario] = {
            entry.policy: {f"seed_{run}": _run(entry, run, shared, curve) for run in range(len(entry.value))}
            for entry, curve in zip(group, found, strict=True)
        }
    return {ENVIRONMENT: tasks}


def _run(entry: SummaryRow, run: int, shared: Sequence[int], curve: tuple[np.ndarray, np.ndarray]) -> dict[str, Any]:
    steps, values = curve
    by_step = dict(zip(steps.tolist(), values[run].tolist(), strict=True))
    last = entry.value[run].tolist()
    found: dict[str, Any] = {
        f"step_{at}": {"step_count": step, entry.goal.name: [by_step[step]] if by_step else last}
        for at, step in enumerate(shared or [0])
    }
    return {**found, "absolute_metrics": {entry.goal.name: last, "success": entry.success[run].tolist()}}


def _shared_steps(found: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[int]:
    """Return the steps that all curves have; those without steps are left out."""
    known: list[set[int]] = [set(steps.tolist()) for steps, _ in found if steps.size]
    return sorted(set.intersection(*known)) if known else []


def rliable(entries: Sequence[SummaryRow]) -> dict[str, Any]:
    """Return results as rliable takes them (Agarwal et al. 2021), of policies that were evaluated on every task.

    Returns:
        ``tasks``, the scenarios; ``scores``, by policy [runs, tasks], the mean of each run's last evaluation, of as
        many runs as all its tasks have; and ``frames`` with ``curves``, by policy [runs, tasks, steps], at the steps
        that all trainings have. Both are negative where less is better.

    Raises:
        ValueError: If no policy was evaluated on every task.
    """
    tasks = list(dict.fromkeys(entry.scenario for entry in entries))
    by_policy: dict[str, dict[str, SummaryRow]] = {}
    for entry in entries:
        by_policy.setdefault(entry.policy, {})[entry.scenario] = entry
    whole = {policy: [each[task] for task in tasks] for policy, each in by_policy.items() if len(each) == len(tasks)}
    if not whole:
        raise ValueError(f"no policy was evaluated on all of {', '.join(tasks)}")
    scores = {policy: _stacked([_scores(entry) for entry in rows]) for policy, rows in whole.items()}
    found = {policy: [_rising(entry) for entry in rows] for policy, rows in whole.items() if rows[0].folders}
    steps = _shared_steps([each for rows in found.values() for each in rows])
    trained = {policy: rows for policy, rows in found.items() if steps and all(each.size for each, _ in rows)}
    over_steps = {
        policy: _stacked([values[:, np.isin(places, steps)] for places, values in rows])
        for policy, rows in trained.items()
    }
    return {"tasks": tasks, "scores": scores, "frames": steps, "curves": over_steps}


def _scores(entry: SummaryRow) -> np.ndarray:
    """Return the mean of each run's last evaluation, where more is better, float64 [runs]."""
    means: np.ndarray = sign_of(entry.goal) * entry.value.mean(axis=1)
    return means


def _rising(entry: SummaryRow) -> tuple[np.ndarray, np.ndarray]:
    """Return ``curves``, where more is better."""
    steps, values = curves(entry)
    return steps, sign_of(entry.goal) * values


def _stacked(tasks: Sequence[np.ndarray]) -> list[Any]:
    """Return values [runs, ...] of each task as [runs, tasks, ...], of the runs that all tasks have."""
    runs = min(len(values) for values in tasks)
    stacked: list[Any] = np.stack([values[:runs] for values in tasks], axis=1).tolist()
    return stacked


def seed_bands(entry: SummaryRow) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a policy's curve: steps, mean over seeds, and its 95 % bootstrap interval over them, [n] each."""
    steps, values = curves(entry)
    bounds = [interval(values[:, at : at + 1], lambda each: each.mean(axis=-1)) for at in range(len(steps))]
    low, high = np.array(bounds).reshape(-1, 2).T
    return steps, values.mean(axis=0), low, high


def draw_curves(entries: Sequence[SummaryRow], path: Path) -> None:
    """Draw the goal over training, by scenario: the mean over seeds, in a band of its 95 % interval.

    Raises:
        ValueError: If no run has a ``metrics.csv``, or Matplotlib does not write such a file.
        ImportError: If Matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    drawn = [(entry, band) for entry in entries if entry.folders and (band := seed_bands(entry))[0].size]
    if not drawn:
        raise ValueError("no run has a metrics.csv with what its policies are compared by")
    scenarios = list(dict.fromkeys(entry.scenario for entry, _ in drawn))
    policies = list(dict.fromkeys(entry.policy for entry, _ in drawn))
    figure = Figure(figsize=(7.0, 2.6 * len(scenarios)), dpi=140, layout="constrained")
    axes = dict(zip(scenarios, figure.subplots(len(scenarios), 1, squeeze=False)[:, 0], strict=True))
    for entry, (steps, mean, low, high) in drawn:
        look, panel = line_style(policies.index(entry.policy)), axes[entry.scenario]
        count = f"{len(entry.value)} seed{'s' if len(entry.value) > 1 else ''}"
        factor = FORMS[entry.goal.unit].factor
        panel.plot(steps, factor * mean, label=f"{entry.policy} ({count})".replace("$", r"\$"), **look)
        panel.fill_between(steps, factor * low, factor * high, color=look["color"], alpha=0.2, linewidth=0.0)
        panel.set(xlabel="world steps", ylabel=on_axis(entry.goal))
    for scenario, panel in axes.items():
        panel.set_title(scenario.replace("$", r"\$"), fontsize=8.0, loc="left")
        panel.legend(fontsize=7.0, frameon=False)
    with disk.drafted(path) as draft:
        figure.savefig(draft, format=path.suffix[1:] or "png", metadata={"Software": None})
