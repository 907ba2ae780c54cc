"""Checked reading of ``evaluation.json``."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from warp_torchrl.evaluation.units import FORMS
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.destination import LARGEST_EVALUATION
from warp_torchrl.system.foreign import Foreign, read_json
from warp_torchrl.system.foreign_text import plain_text

_TEXTS = ("scenario", "method", "configuration")
_LARGEST_NUMBER = 1e15
_LONGEST = 200  # characters of a name
_SAVED = {"goal": "saved", "goal_better": "more", "goal_unit": "%"}  # of files without a goal
_MOST_EPISODES = 100_000


def read_evaluation(path: Path) -> dict[str, Any]:
    """Return the content of an ``evaluation.json``, its names as plain lines.

    Raises:
        ConfigError: If it is no evaluation, in one line.
        OSError: If it cannot be opened.
    """
    try:
        content = read_json(path, LARGEST_EVALUATION)
        _check(content)
    except Foreign as error:
        raise ConfigError(str(error)) from None
    except ValueError as error:
        raise ConfigError(f"{path} is no evaluation: {error}") from None
    texts = {key: plain_text(content[key], _LONGEST) for key in _TEXTS}
    overrides = [plain_text(each, _LONGEST) for each in content.get("world_overrides", [])]
    baselines = content.get("baseline_episodes", {})
    named = {plain_text(name, _LONGEST): episodes for name, episodes in baselines.items()}
    return {**_SAVED, **content, **texts, "world_overrides": overrides, "baseline_episodes": named}


def _check(content: Any) -> None:
    if not isinstance(content, dict):
        raise ValueError("it must be a mapping")
    for key in _TEXTS:
        if not isinstance(content.get(key), str):
            raise ValueError(f"{key} must be a text, got {content.get(key)!r:.80}")
    overrides, goal = content.get("world_overrides", []), content.get("goal", "saved")
    if not (isinstance(overrides, list) and all(isinstance(each, str) for each in overrides)):
        raise ValueError("world_overrides must be texts")
    if not (isinstance(goal, str) and goal.isidentifier() and len(goal) <= _LONGEST):
        raise ValueError(f"goal must name a metric, got {goal!r:.80}")
    for key, known in (("goal_better", ("more", "less")), ("goal_unit", tuple(FORMS))):
        if content.get(key, _SAVED[key]) not in known:
            raise ValueError(f"{key} must be one of {', '.join(known)}, got {content[key]!r:.80}")
    seeds: Any = content.get("seeds")
    is_some = isinstance(seeds, list) and 0 < len(seeds) <= _MOST_EPISODES
    if not (is_some and all(type(seed) is int for seed in seeds)):
        raise ValueError(f"seeds must be 1 to {_MOST_EPISODES} whole numbers")
    _check_episodes(content.get("episodes"), len(seeds), goal)
    _check_baselines(content.get("baseline_episodes", {}), len(seeds), goal)


def _check_episodes(episodes: Any, count: int, goal: str) -> None:
    is_table = isinstance(episodes, list) and all(isinstance(each, dict) for each in episodes)
    if not is_table or len(episodes) != count:
        raise ValueError(f"episodes must be one for each of {count} seeds")
    if any(each.keys() != episodes[0].keys() for each in episodes):
        raise ValueError("episodes must have the same metrics")
    for name in episodes[0]:
        _check_numbers(name, [each[name] for each in episodes], may_lack=name not in (goal, "success"))
    _check_has(episodes[0], goal)


def _check_baselines(baselines: Any, count: int, goal: str) -> None:
    if not isinstance(baselines, dict):
        raise ValueError("baseline_episodes must be a mapping")
    for name, episodes in baselines.items():
        if not isinstance(episodes, dict):
            raise ValueError(f"the episodes of {name[:80]} must be a mapping")
        _check_has(episodes, goal)
        for metric, values in episodes.items():
            if not isinstance(values, list) or len(values) != count:
                raise ValueError(f"{metric[:80]} of {name[:80]} must be one for each of {count} seeds")
            _check_numbers(metric, values, may_lack=metric not in (goal, "success"))


def _check_has(metrics: Mapping[str, Any], goal: str) -> None:
    for name in (goal, "success"):
        if name not in metrics:
            raise ValueError(f"episodes must have {name}")


def _check_numbers(name: str, values: Sequence[Any], *, may_lack: bool) -> None:
    for value in values:
        is_number = type(value) in (int, float, bool) and abs(value) <= _LARGEST_NUMBER and isfinite(value)
        if not is_number and not (value is None and may_lack):
            raise ValueError(f"{name[:80]} must hold finite numbers, got {value!r:.80}")
