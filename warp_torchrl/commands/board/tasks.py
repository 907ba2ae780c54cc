"""Frozen lists of tasks, as ``conf/board`` holds them."""

import json
from collections.abc import Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, conf_folder
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.system.foreign_yaml import read_yaml
from warp_torchrl.validation import check_fields, did_you_mean
from warp_torchrl.world.world import World

NEWEST = "warp-v1"
"""The board that is played where none is named."""
_FIRST, _SPAN = 2**40, 2**56
"""Where the seeds of tasks lie: apart from those of other evaluations, and from those of trainings."""
_DIGITS = 16  # hexadecimal ones of a hash


@dataclass(frozen=True, kw_only=True)
class Task:
    """A task of a board.

    Attributes:
        board: Name of its board, a part of its seeds.
        name: Its name.
        about: What it asks, in a line.
        scenario: The scenario whose worlds it has, but for the overrides.
        overrides: Of the worlds alone.
        rules: Hash of its rules: see ``rules_of``.
        fires: Worlds.
        noop: What doing nothing reaches in its goal: 0 points of the board.
        reference: What ``dispatch`` reaches that knows what its team knows: 100 points.
    """

    board: str
    name: str
    about: str
    scenario: str
    overrides: tuple[str, ...] = ()
    rules: str
    fires: int
    noop: float
    reference: float

    def __post_init__(self) -> None:
        check_fields(self, fires=(1, 100_000))
        if self.noop == self.reference:
            raise ValueError("reference must be another number than noop")

    @property
    def first_seed(self) -> int:
        """Return the seed of world 0, by a hash of the names of board and task; world i has that one + i."""
        digest = sha256(f"{self.board} {self.name}".encode()).digest()
        return _FIRST + int.from_bytes(digest[:8], "big") % _SPAN

    @cached_property
    def world(self) -> World:
        """Return its rules as this version of the package has them."""
        return world_of(self.scenario, self.overrides)

    @property
    def found_rules(self) -> str:
        """Return the hash of the rules that this version of the package gives the task."""
        return rules_of(self.world)

    def points(self, value: float) -> float:
        """Return the points of a mean: 0 for ``noop``, 100 for ``reference``."""
        return 100.0 * (value - self.noop) / (self.reference - self.noop)


@dataclass(frozen=True, kw_only=True)
class Budget:
    """What all trainings of a team together may take, that its row has a place among the others.

    Attributes:
        steps: World steps.
        minutes: By the wall clock, on whatever machine; of policies that did not take them steps alone count.
    """

    steps: int
    minutes: float

    def __post_init__(self) -> None:
        check_fields(self, steps=(1, 10**15), minutes=(0.1, 1e9))

    def allows(self, steps: int | None, minutes: float | None) -> bool:
        """Return whether trainings that took so much are within it; those of baselines took nothing."""
        return (steps or 0) <= self.steps and (minutes or 0.0) <= self.minutes


@dataclass(frozen=True, kw_only=True)
class Board:
    """A frozen list of tasks.

    Attributes:
        name: Its name and version.
        budget: Of a team's trainings.
        tasks: The tasks by name.
    """

    name: str
    budget: Budget
    tasks: dict[str, Task]

    def chosen(self, names: Sequence[str] | None) -> list[Task]:
        """Return some tasks, or all of them.

        Raises:
            ConfigError: If it has no such task.
        """
        for name in names or ():
            if name not in self.tasks:
                known = ", ".join(self.tasks)
                raise ConfigError(f"tasks of {self.name} are {known}, got {name}{did_you_mean(name, list(self.tasks))}")
        return [self.tasks[name] for name in names or self.tasks]


def boards() -> list[str]:
    """Return the names of the boards."""
    return sorted(path.stem for path in (conf_folder() / "board").glob("*.yaml"))


def read_board(name: str = NEWEST) -> Board:
    """Return a board.

    Raises:
        ConfigError: If there is none of that name.
    """
    if name not in boards():
        raise ConfigError(f"board must be one of {', '.join(boards())}, got {name}{did_you_mean(name, boards())}")
    content = read_yaml(conf_folder() / "board" / f"{name}.yaml")
    common = {"board": name, "fires": content["fires"]}
    budget = Budget(**content["budget"])
    return Board(
        name=name, budget=budget, tasks={key: Task(name=key, **common | task) for key, task in content["tasks"].items()}
    )


def world_of(scenario: str, overrides: Sequence[str]) -> World:
    """Return the world of a scenario with overrides."""
    return run_config(plain(compose_config("train", [f"scenario={scenario}", *overrides]))).world


def rules_of(world: World) -> str:
    """Return a hash of a world's rules, 16 hexadecimal digits.

    It covers the class of each component, and each value that is not its default. So a key that is new to a class
    leaves the hash as it was, and a default that changes needs a new board.
    """
    return sha256(json.dumps(_rules(world), sort_keys=True).encode()).hexdigest()[:_DIGITS]


def _rules(part: Any) -> Any:
    if is_dataclass(part) and not isinstance(part, type):
        values = {each.name: getattr(part, each.name) for each in fields(part) if each.init and each.repr}
        unusual = {each.name: values[each.name] for each in fields(part) if each.name in values and _is_own(each, part)}
        return [type(part).__name__, {name: _rules(value) for name, value in unusual.items()}]
    if isinstance(part, list | tuple):
        return [_rules(each) for each in part]
    if isinstance(part, dict):
        return {str(key): _rules(value) for key, value in part.items()}
    return part if isinstance(part, bool | int | float | str | None) else repr(part)


def _is_own(field: Field[Any], part: Any) -> bool:
    """Return whether a component has another value of a field than the field's default."""
    usual = field.default if field.default_factory is MISSING else field.default_factory()
    return usual is MISSING or getattr(part, field.name) != usual
