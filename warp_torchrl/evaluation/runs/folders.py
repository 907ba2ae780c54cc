"""Run folders for learning curves, read without instantiating anything from their configuration."""

import csv
import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.evaluation.goal import SAVED as SAVED_TREES
from warp_torchrl.evaluation.method import method, teacher_label, unusual
from warp_torchrl.evaluation.reading import read_evaluation
from warp_torchrl.evaluation.report import goal_of
from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError, newest
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.saved_config import SavedConfig, completed
from warp_torchrl.system.foreign import Foreign, open_file
from warp_torchrl.system.foreign_yaml import read_yaml
from warp_torchrl.world.mechanics.mechanic import Metric

FRAMES, SECONDS, FPS, SAVED = "time/frames", "time/seconds", "time/fps", "world/saved"
MOST_ROWS = 400
"""Files of more rows are averaged over bins."""
_LARGEST = 100_000_000  # bytes


@dataclass(frozen=True, kw_only=True)
class Run:
    """Configuration and metrics of a run folder.

    Attributes:
        folder: Path.
        rows: Columns of ``metrics.csv``, [rows] each, NaN where a value is missing.
        columns: The same as means over bins, [bins] each, at most ``MOST_ROWS``.
        rows_per_bin: Rows in a bin.
        names: Algorithm and teacher, reward, observation and scenario; the folder's name where nothing is recorded.
        alike: Equal for runs that differ in their seed only.
        mark: Distinguishes runs of the same names.
        scenario: Name of the scenario.
        n_agents: A; None where it is not recorded.
        seed: None where it is not recorded.
        goal: What policies are compared by in the run's worlds, as its ``evaluation.json`` says; the forest saved where
            there is none yet.
        called: Name in the figure, if the user gave one.
    """

    folder: Path
    rows: Mapping[str, np.ndarray]
    columns: Mapping[str, np.ndarray]
    rows_per_bin: int
    names: tuple[str, ...]
    alike: str
    mark: str
    scenario: str
    n_agents: int | None
    seed: str | None
    goal: Metric = SAVED_TREES
    called: str = ""


def run_folders(paths: Sequence[Path]) -> list[Path]:
    """Return the run folders of the given paths, each once: a run itself, or all runs of a sweep."""
    found: dict[Path, Path] = {}
    for path in paths:
        if not path.is_dir():
            raise ValueError(f"RUN must be the folder of a run or of a sweep, got {path}")
        below = [path] if (path / "metrics.csv").exists() else [file.parent for file in path.glob("**/metrics.csv")]
        if not below:
            raise ValueError(f"{path} holds no metrics.csv, nor do its sub-folders")
        for folder in sorted(below, key=lambda each: (len(str(each)), str(each))):  # job 2 comes before job 10
            found.setdefault(folder.resolve(), folder)
    return list(found.values())


def read_run(folder: Path) -> Run:
    """Return the content of a run folder, without instantiating anything."""
    rows = read_metrics(folder / "metrics.csv")
    rows_per_bin = math.ceil(len(rows[FRAMES]) / MOST_ROWS)
    columns = {name: bin_means(values, rows_per_bin) for name, values in rows.items()}
    try:
        found, _ = newest(folder)
        trained = _recorded(found, found.saved_config())
    except CheckpointError:  # none was saved yet
        trained = _not_recorded(folder.resolve())
    goal = _goal(folder / "evaluation.json")
    return Run(folder=folder, rows=rows, columns=columns, rows_per_bin=rows_per_bin, goal=goal, **trained)


def _goal(path: Path) -> Metric:
    try:
        return goal_of(read_evaluation(path))
    except (OSError, ConfigError):  # the training has not ended yet, or was evaluated elsewhere
        return SAVED_TREES


def read_metrics(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a ``metrics.csv``, float64 [rows], NaN where a cell is empty or not finite.

    Raises:
        ValueError: If it is over 100 MB or malformed.
    """
    with TextIOWrapper(open_file(path, _LARGEST), encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        try:
            header = next(lines, [])
            if FRAMES not in header:
                raise ValueError(f"it has no column {FRAMES}")
            cells = array("d")  # a list of Python's numbers would be four times as large
            for line in lines:
                cells.extend(_numbers(line, header, lines.line_num))
            columns = dict(zip(header, np.array(cells).reshape(-1, len(header)).T))
            _check_time(columns)
        except (csv.Error, ValueError) as error:
            raise ValueError(f"{path} is malformed: {error}") from None
    return columns


def _numbers(cells: Sequence[str], header: Sequence[str], number: int) -> list[float]:
    if len(cells) != len(header):
        raise ValueError(f"line {number} has {len(cells)} cells, the header has {len(header)}")
    values = []
    for name, cell in zip(header, cells):
        try:
            value = float(cell) if cell else math.nan
        except ValueError:
            raise ValueError(f"line {number}, {name}: {cell[:40]!r} is not a number") from None
        values.append(value if math.isfinite(value) else math.nan)
    return values


def _check_time(columns: Mapping[str, np.ndarray]) -> None:
    if not columns[FRAMES].size:
        raise ValueError("it has no rows")
    for name in (FRAMES, SECONDS):
        times = columns.get(name, columns[FRAMES])
        if not (np.diff(times, prepend=0.0) > 0.0).all():  # False for NaN too
            raise ValueError(f"{name} must be in every row, positive, and grow")


def _recorded(found: Checkpoint, saved_config: SavedConfig) -> dict[str, Any]:
    try:
        algorithm, reward, observation = (
            str(saved_config.choices[group]) for group in ("algorithm", "reward", "observation")
        )
        names = (" ".join((algorithm, *unusual(saved_config), *teacher_label(saved_config))), reward, observation)
        _, digest = method(_completed(saved_config))
        n_agents, seed = saved_config.values["team"]["n_agents"], str(saved_config.values["seed"])
    except (KeyError, TypeError, AttributeError):
        raise ValueError(f"{found.path / 'config.json'} does not hold a run's configuration") from None
    scenario = str(found.manifest.scenario)
    alike = " ".join((scenario, *names, digest))
    fields = {"names": (*names, scenario), "alike": alike, "mark": digest[:6]}
    return fields | {"scenario": scenario, "n_agents": n_agents, "seed": seed}


def _completed(saved_config: SavedConfig) -> SavedConfig:
    """Return a configuration with this version's keys, or unchanged if its keys are others."""
    try:
        return completed(saved_config)
    except ConfigError:
        return saved_config


def _not_recorded(folder: Path) -> dict[str, Any]:
    """Return the description of a run without a checkpoint: its name, and its ``config.yaml``."""
    content, path = {}, folder / "config.yaml"
    if path.exists():
        try:
            content = read_yaml(path)
        except Foreign as error:
            raise ValueError(f"{path} is not a run's configuration: {error}") from None
    content = content if isinstance(content, dict) else {}
    team, scenario = content.get("team"), content.get("scenario")
    fields = {"names": (folder.name,), "alike": str(folder), "mark": f"in {folder.parent.name}"}
    n_agents = team.get("n_agents") if isinstance(team, dict) else None
    scenario = scenario if isinstance(scenario, str) else "not recorded"
    return fields | {"scenario": scenario, "n_agents": n_agents, "seed": None}


def bin_means(values: np.ndarray, size: int) -> np.ndarray:
    """Return the means over bins of ``size`` rows, the last of the rest; NaN where a bin has no value."""
    if size == 1:
        return values
    starts, there = np.arange(0, len(values), size), np.isfinite(values)
    sums, counts = (np.add.reduceat(each, starts) for each in (np.where(there, values, 0.0), there.astype(float)))
    return np.where(counts > 0, sums / counts.clip(1), math.nan)
