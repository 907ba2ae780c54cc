"""Rows of a board: what a policy reached in its tasks, with hashes of policy, code and rules, and a seal over all."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import Any, get_args

import numpy as np

from warp_torchrl.commands.board.knowledge import Knowledge
from warp_torchrl.evaluation.units import FORMS
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system import disk
from warp_torchrl.system.foreign import Foreign, read_json
from warp_torchrl.system.foreign_text import plain_text
from warp_torchrl.world.mechanics.mechanic import Metric

_LARGEST = 50_000_000  # bytes of a file
_MOST = 100_000  # values of a task
_LONGEST = 200  # characters of a name


@dataclass(frozen=True, kw_only=True)
class Played:
    """What a policy reached in a task.

    Attributes:
        rules: Hash of the rules that were played.
        goal: The task's metric.
        better: ``more`` or ``less``.
        unit: Of the metric.
        first_seed: Seed of world 0.
        knowledge: What the agents knew.
        values: The metric by world.
    """

    rules: str
    goal: str
    better: str
    unit: str
    first_seed: int
    knowledge: Knowledge
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.better not in ("more", "less") or self.unit not in FORMS or self.knowledge not in get_args(Knowledge):
            raise ValueError("better, unit and knowledge must be of the words for them")
        if not (0 < len(self.values) <= _MOST and all(type(each) is float and isfinite(each) for each in self.values)):
            raise ValueError(f"values must be 1 to {_MOST} finite numbers")

    @property
    def metric(self) -> Metric:
        """Return the task's metric."""
        return Metric(self.goal, self.better, self.unit)  # type: ignore[arg-type]

    @property
    def mean(self) -> float:
        """Return the mean over the worlds."""
        return float(np.mean(self.values))


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a board.

    Attributes:
        board: Name of the board.
        name: Name of the row in tables.
        policy: Hash of the policy: of its weights and configuration, or a baseline's name.
        trained: Its trainings in a line; empty for what was not trained.
        steps: World steps of all its trainings; None for what was not trained.
        minutes: Of all its trainings by the wall clock; None where they are not known.
        code: Hash of the sources that played it.
        made: Day, version of the package and of torch.
        options: Overrides beside the tasks' own: what the team believes.
        tasks: What it reached, by task.
    """

    board: str
    name: str
    policy: str
    trained: str = ""
    steps: int | None = None
    minutes: float | None = None
    code: str
    made: Mapping[str, str]
    options: tuple[str, ...] = ()
    tasks: Mapping[str, Played] = field(default_factory=dict)

    @property
    def seal(self) -> str:
        """Return the sha256 of everything in the row."""
        return sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()


def write_row(path: Path, row: Row) -> None:
    """Write a row with its seal, as JSON.

    Raises:
        OSError: If it cannot be written.
    """
    disk.replace(path, json.dumps({**asdict(row), "seal": row.seal}, indent=1) + "\n")


def read_row(path: Path) -> Row:
    """Return the row that a file holds.

    Raises:
        ConfigError: If it is none, or was changed after it was sealed; in one line.
        OSError: If it cannot be opened.
    """
    try:
        content = read_json(path, _LARGEST)
        row, seal = _row(content), content["seal"]
    except Foreign as error:
        raise ConfigError(str(error)) from None
    except (TypeError, KeyError, AttributeError, ValueError) as error:
        raise ConfigError(f"{path} is no row of a board: {' '.join(str(error).split())}") from None
    if seal != row.seal:
        raise ConfigError(f"{path} was changed after it was written: its seal does not match")
    return row


def _row(content: Any) -> Row:
    if not isinstance(content, dict):
        raise TypeError("it must be a mapping")
    given = {key: value for key, value in content.items() if key != "seal"}
    texts = [given[key] for key in ("board", "name", "policy", "trained", "code")]
    texts += [*given["options"], *given["made"].values(), *given["made"], *given["tasks"]]
    for text in texts:
        if not isinstance(text, str) or plain_text(text, _LONGEST) != text:
            raise ValueError(f"names must be lines of at most {_LONGEST} characters")
    if not (given["steps"] is None or (type(given["steps"]) is int and given["steps"] >= 0)):
        raise ValueError("steps must be a whole number")
    minutes = given.get("minutes")
    if not (minutes is None or (type(minutes) is float and 0.0 <= minutes < 1e9)):
        raise ValueError("minutes must be a number")
    tasks = {name: Played(**{**each, "values": tuple(each["values"])}) for name, each in given["tasks"].items()}
    return Row(**{**given, "options": tuple(given["options"]), "tasks": tasks})
