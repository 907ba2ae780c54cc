"""Rows of tables of many runs, from their ``evaluation.json`` files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.reading import read_evaluation
from warp_torchrl.evaluation.report import goal_of, worlds_name
from warp_torchrl.world.mechanics.mechanic import Metric

_Key = tuple[str, str, str, tuple[int, ...]]  # scenario, method, configuration, seeds


class SummaryRow(NamedTuple):
    """Results of a policy on a scenario, over all runs that differ in their seed only."""

    scenario: str
    policy: str
    value: np.ndarray  # of the goal, [runs, n]
    success: np.ndarray  # [runs, n]
    seeds: tuple[int, ...]
    metrics: Mapping[str, np.ndarray] = {}  # by name, [runs, n], NaN where an episode has none; empty for baselines
    goal: Metric = SAVED  # what policies are compared by there
    folders: tuple[Path, ...] = ()  # of the runs; none of baselines


def read_rows(*folders: Path) -> list[SummaryRow]:
    """Return the results in the ``evaluation.json`` files under folders, baselines included.

    Runs that differ in their seed only are one entry.

    Raises:
        ConfigError: If a file is no evaluation, in one line.
        OSError: If one cannot be opened.
    """
    found: dict[_Key, list[Mapping[str, Any]]] = {}
    for path in (path for folder in folders for path in sorted(folder.glob("**/evaluation.json"))):
        content = {**read_evaluation(path), "folder": path.parent}
        key = (worlds_name(content), content["method"], content["configuration"], tuple(content["seeds"]))
        found.setdefault(key, []).append(content)
    several = {(scenario, method) for scenario, method, *_ in found if _differ(found, scenario, method)}
    return _baselines(found) + [
        SummaryRow(
            scenario,
            f"{method} {configuration[:6]}" if (scenario, method) in several else method,
            _of_episodes(runs, runs[0]["goal"]),
            _of_episodes(runs, "success"),
            seeds,
            {name: _of_episodes(runs, name) for name in runs[0]["episodes"][0] if name != "seed"},
            goal_of(runs[0]),
            tuple(run["folder"] for run in runs),
        )
        for (scenario, method, configuration, seeds), runs in found.items()
    ]


def _baselines(found: Mapping[_Key, Sequence[Mapping[str, Any]]]) -> list[SummaryRow]:
    """Return the baselines in other policies' evaluations that have no evaluation of their own.

    A baseline whose episodes differ between evaluations played in different worlds, and is left out.
    """
    held: dict[tuple[str, str, Metric, tuple[int, ...]], list[Mapping[str, Any]]] = {}
    for (scenario, _, _, seeds), runs in found.items():
        for run in runs:
            for name, episodes in run["baseline_episodes"].items():
                if (scenario, name, "", seeds) not in found:
                    held.setdefault((scenario, name, goal_of(run), seeds), []).append(episodes)
    return [
        SummaryRow(
            scenario, name, np.array([episodes[0][goal.name]]), np.array([episodes[0]["success"]]), seeds, goal=goal
        )
        for (scenario, name, goal, seeds), episodes in held.items()
        if all(each == episodes[0] for each in episodes)
    ]


def _of_episodes(runs: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    """Return a metric of each episode of each run, [runs, n]."""
    return np.array([[episode.get(name) for episode in run["episodes"]] for run in runs], dtype=np.float64)


def _differ(found: Mapping[_Key, Any], scenario: str, method: str) -> bool:
    return len({key[2] for key in found if key[:2] == (scenario, method)}) > 1
