"""Keywords beside overrides: options and values by the names of the configuration, and components as objects."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import PurePath
from typing import Any

from warp_torchrl.env.observation import Observation
from warp_torchrl.env.reward import Reward
from warp_torchrl.runs.config.compose import OPTION
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError

_ANY_KEYS = ("mechanics", "mixture", "curriculum")
"""Groups with mappings of any keys, to which overrides add."""
_KINDS: dict[str, Any] = {"observation": Observation, "reward": Reward}


def check_list(name: str, given: object) -> None:
    """Check that a list is no text, whose letters would be its items.

    Raises:
        ConfigError: If it is, or no list at all.
    """
    if isinstance(given, str):
        raise ConfigError(f"{name} must be a list of texts, [{given!r}], got the text {given!r}")
    if not isinstance(given, Sequence):
        raise ConfigError(f"{name} must be a list of texts, got {given!r}")
    for each in given:
        if not isinstance(each, str):
            raise ConfigError(f"{name} must be a list of texts, got {each!r} in it")


def as_overrides(keywords: Mapping[str, Any]) -> tuple[list[str], dict[str, Any]]:
    """Return keywords as overrides, and the components that are objects.

    Args:
        keywords: By key: the name of an option, ``fire="paper"``; a value, ``horizon=64``; values by key,
            ``team=dict(n_agents=3)``; or a component, ``landscape=Array(cover=cover)``.

    Raises:
        ConfigError: If a value cannot be written as an override, or an object stands for no component.
    """
    overrides: list[str] = []
    objects: dict[str, Any] = {}
    for key, value in keywords.items():
        if is_dataclass(value) and not isinstance(value, type):
            if key not in COMPONENTS:
                raise ConfigError(f"{key} must be no object; {', '.join(COMPONENTS)} may be, got {value!r}")
            if not isinstance(value, _KINDS.get(key, object)):
                raise ConfigError(f"{key} must be a component of {key}, got {value!r}")
            objects[key] = value
        else:
            overrides += (f"{'++' if key in _ANY_KEYS and '.' in path else ''}{path}={_written(leaf, path)}"
                          for path, leaf in _leaves(key, value))  # fmt: skip
    return overrides, objects


def _leaves(path: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for key, each in value.items():
            yield from _leaves(f"{path}.{key}", each)
    else:
        yield path, value


def _written(value: Any, path: str) -> str:
    """Return a value in the grammar of the command line."""
    if isinstance(value, str) and OPTION.fullmatch(value):
        return value
    if isinstance(value, PurePath):
        value = str(value)
    try:
        return json.dumps(value.item() if hasattr(value, "item") else value)
    except (TypeError, ValueError, RuntimeError):
        hint = "; landscape=Array(...) takes arrays" if path.startswith("landscape.") else ""
        raise ConfigError(f"{path} must be a plain value or a list, got {type(value).__name__}{hint}") from None
