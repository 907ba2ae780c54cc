"""The trainings behind a policy: stages with their world steps, teachers and advisers, as a manifest keeps them."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from warp_torchrl.system.foreign_text import plain_text

MEAN = "mean"
"""Algorithm of a stage that is no training: the mean of the parameters of its parents."""
UNKNOWN = "unknown"
"""Key of a parent of which no manifest says anything."""
_KEY = 16  # hexadecimal digits
_LONGEST = 200  # characters of a name
_MOST = 1000  # stages, and teachers or parents of one
_NOT_OF_TRAINING = ("total_frames", "start_from", "evaluation", "checkpoint", "logger", "device", "processes")


@dataclass(frozen=True, kw_only=True)
class Teacher:
    """A teacher of a training.

    Attributes:
        name: Of a baseline, of a shipped policy or of a run's folder; ``people`` for demonstrations.
        steps: World steps of a trained policy's history; None for a baseline and for people.
    """

    name: str
    steps: int | None = None


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A training in the history of a policy, or a mean of policies.

    Attributes:
        key: 16 hexadecimal digits, equal for checkpoints of one training.
        steps: World steps of this training alone; 0 of a mean.
        worlds: Scenario, and the option of the mixture or the curriculum.
        algorithm: Option of the algorithm, or ``mean``.
        teachers: Teachers beside the rewards.
        adviser: Heuristic whose advice the agents observe; None without one.
        parents: Keys of the stages whose networks it began with, or whose mean it is.
        minutes: Of this training by the wall clock; None of a mean, and where no one took them.
    """

    key: str
    steps: int
    worlds: str
    algorithm: str
    teachers: tuple[Teacher, ...] = ()
    adviser: str | None = None
    parents: tuple[str, ...] = ()
    minutes: float | None = None


History = tuple[Stage, ...]
"""Stages with parents first; the last is the policy's own."""


def trained_steps(history: History) -> int:
    """Return the world steps of all trainings of a history, each counted once."""
    return sum(stage.steps for stage in history)


def trained_minutes(history: History) -> float | None:
    """Return the minutes of all trainings of a history; None where those of one are not known."""
    minutes = [stage.minutes for stage in history if stage.algorithm != MEAN]
    return None if None in minutes else sum(each for each in minutes if each is not None)


def taught_by(history: History) -> tuple[Teacher, ...]:
    """Return the teachers of all trainings of a history, each once."""
    return tuple(dict.fromkeys(teacher for stage in history for teacher in stage.teachers))


def history_line(history: History) -> str:
    """Return the world steps, the teachers and the adviser of a history in one line."""
    trainings = sum(stage.algorithm != MEAN for stage in history)
    teachers = dict.fromkeys(teacher.name for teacher in taught_by(history))
    parts = [f"{trained_steps(history):,} world steps in {trainings} training{'s' * (trainings != 1)}"]
    parts += [f"taught by {', '.join(teachers)}"] if teachers else []
    parts += [f"advised by {history[-1].adviser}"] if history[-1].adviser else []
    return "; ".join(parts)


def joined(histories: Iterable[History]) -> History:
    """Return the stages of several histories, each once, with the most steps that any of them has."""
    found: dict[str, Stage] = {}
    for stage in (stage for history in histories for stage in history):
        known = found.get(stage.key, stage)
        found[stage.key] = stage if stage.steps >= known.steps else known
    return tuple(found.values())


def mean_of(histories: Sequence[History]) -> History:
    """Return the history of the mean of policies: the stages of all, and the mean."""
    lasts = [history[-1] for history in histories]
    parents = tuple(dict.fromkeys(stage.key for stage in lasts))
    key = _digest([MEAN, [[stage.key, stage.steps] for stage in lasts]])
    mean = Stage(key=key, steps=0, worlds=lasts[0].worlds, algorithm=MEAN, adviser=lasts[0].adviser, parents=parents)
    return (*joined(histories), mean)


def stage_of(
    choices: Mapping[str, Any], values: Mapping[str, Any], scenario: str, before: History, teachers: Iterable[Teacher]
) -> Stage:
    """Return the stage of a training at its start, with 0 steps.

    Args:
        choices: Option of each group.
        values: The training's configuration.
        scenario: Name of the scenario.
        before: History of what it starts from; empty where its networks are new.
        teachers: Teachers beside the rewards.
    """
    parents = (before[-1].key,) if before else ((UNKNOWN,) if values.get("start_from") else ())
    trained = {key: value for key, value in values.items() if key not in _NOT_OF_TRAINING}
    groups = {group: choices.get(group, "none") for group in ("curriculum", "mixture")}
    worlds = [scenario, *(f"{group}={option}" for group, option in groups.items() if option != "none")]
    observation = values.get("observation")
    return Stage(
        key=_digest([dict(choices), trained, parents]),
        steps=0,
        worlds=" ".join(worlds),
        algorithm=str(choices.get("algorithm", "")),
        teachers=tuple(teachers),
        adviser=observation.get("advice") if isinstance(observation, Mapping) else None,
        parents=parents,
    )


def with_steps(stage: Stage, steps: int, minutes: float | None = None) -> Stage:
    """Return the stage of a training after some world steps, and minutes where they are known."""
    return replace(stage, steps=steps, minutes=minutes)


def teacher_names(values: Mapping[str, Any]) -> list[str]:
    """Return the names of the teachers in a training's configuration, ``people`` for demonstrations."""
    imitation, mixture = (values.get(key) or {} for key in ("imitation", "mixture"))
    kinds = (mixture.get("kinds") or {}).values() if isinstance(mixture, Mapping) else ()
    named = [imitation.get("guide"), imitation.get("teacher"), *(kind.get("teacher") for kind in kinds)]
    people = ["people"] if imitation.get("demonstrations") else []
    return [*dict.fromkeys(str(name) for name in named if name), *people]


def history_to_plain(history: History) -> list[dict[str, Any]]:
    """Return a history as a manifest keeps it."""
    return [asdict(stage) for stage in history]


def history_from_plain(content: object) -> History:
    """Return the history that a manifest keeps.

    Args:
        content: From a file: not trusted.

    Raises:
        ValueError: If it is none, or too long.
        TypeError, KeyError: If stages have other fields.
    """
    stages = tuple(_stage(each) for each in _listed(content))
    known = {stage.key for stage in stages}
    if len(known) < len(stages) or any({*stage.parents} - known - {UNKNOWN} for stage in stages):
        raise ValueError("a history must hold each stage once, and the parents of each")
    return stages


def _stage(node: dict[str, Any]) -> Stage:
    teachers = tuple(
        Teacher(name=_text(each["name"]), steps=None if each["steps"] is None else _whole(each["steps"]))
        for each in _listed(node["teachers"])
    )
    adviser = None if node["adviser"] is None else _text(node["adviser"])
    fields = {**node, "teachers": teachers, "adviser": adviser, "steps": _whole(node["steps"])}
    fields |= {name: _text(node[name]) for name in ("key", "worlds", "algorithm")}
    fields["minutes"] = None if node.get("minutes") is None else _minutes(node["minutes"])
    return Stage(**{**fields, "parents": tuple(_text(each) for each in _listed(node["parents"]))})


def _listed(content: object) -> list[Any]:
    if not isinstance(content, list) or len(content) > _MOST:
        raise ValueError(f"a history must have lists of at most {_MOST}")
    return content


def _text(value: object) -> str:
    if not isinstance(value, str) or plain_text(value, _LONGEST) != value:
        raise ValueError(f"a name in a history must be one line of at most {_LONGEST} characters")
    return value


def _whole(value: object) -> int:
    if type(value) is not int or not 0 <= value < 2**62:
        raise ValueError(f"steps must be a whole number, got {value!r:.40}")
    return value


def _minutes(value: object) -> float:
    if type(value) is not float or not 0.0 <= value < 1e9:
        raise ValueError(f"minutes must be a number, got {value!r:.40}")
    return value


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:_KEY]
