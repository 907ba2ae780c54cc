"""Construction of components from plain configuration nodes: types, unknown keys and the components' rules.

A node names its class in ``_target_``: one of this package's dataclasses, or one that a plug-in has registered. Nothing
else is ever imported by name.
"""

import importlib
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import MISSING, fields, is_dataclass
from inspect import isabstract
from typing import Any, cast, get_origin, get_type_hints

from warp_torchrl.system.excerpt import excerpt
from warp_torchrl.validation import did_you_mean, fit

OF_WORLDS = ("landscape", "wind", "fire", "team", "ignition", "sensing", "belief", "agencies")
"""Groups whose options make a world."""
ENVIRONMENT = (*OF_WORLDS, "observation", "reward")
"""Those that make an environment."""
COMPONENTS = (*ENVIRONMENT, "model", "algorithm", "collector", "curriculum", "mixture", "logger")
"""All groups whose options are classes."""
WORLD_KEYS = ("scenario", *OF_WORLDS, "mechanics", "steps_per_tick", "horizon", "cell_size", "action_masking", "goal")
"""What a scenario sets."""
COMMAND_KEYS = ("resume", "start_from", "debug", "policy", "overwrite", "maps", "maps_fires", "picture")
"""What the commands read themselves."""
_ADDED: dict[str, type] = {}
_BY_EXCERPTS = ContextVar("by_excerpts", default=False)


class ConfigError(ValueError):
    """A mistake in the configuration; the message is one line with key, value and rule."""


class UnknownKeyError(ConfigError):
    """A key that the configuration does not have.

    Args:
        message: One line.
        key: As it was given.
    """

    def __init__(self, message: str, key: str = "") -> None:
        super().__init__(message)
        self.key = key


def build(node: object, where: str) -> Any:
    """Build the component that a configuration node describes.

    Args:
        node: A mapping with ``_target_``, see ``component``, and its fields; or a component.
        where: The node's key, for messages.

    Raises:
        ConfigError: If there is no such component, a key is unknown, or a value breaks a rule.
    """
    if is_dataclass(node) and not isinstance(node, type):
        return node
    if not isinstance(node, Mapping) or "_target_" not in node:
        raise ConfigError(f"{where} must name one of the files of conf/{where}, got {node!r}")
    kind = component(node["_target_"])
    if kind is None:
        raise ConfigError(
            f"{where}._target_ must be a component of warp_torchrl, got {node['_target_']}; one of a plug-in is found "
            "where plugins=[...] lists that"
        )
    return construct(kind, {key: value for key, value in node.items() if key != "_target_"}, where)


def add_component(target: str, kind: type) -> None:
    """Let a ``_target_`` name a dataclass of a plug-in."""
    _ADDED[target] = kind


def component(target: object) -> type | None:
    """Return the dataclass that a ``_target_`` names, of this package or of a plug-in; None where it names another.

    Raises:
        ImportError: If a library that one of this package's modules needs is missing.
    """
    if str(target) in _ADDED:
        return _ADDED[str(target)]
    module, _, name = str(target).rpartition(".")
    if not re.fullmatch(r"warp_torchrl(\.\w+)*", module):
        return None
    if _BY_EXCERPTS.get():
        return cast("type", excerpt(module, name))
    try:
        found = getattr(importlib.import_module(module), name, None)
    except ModuleNotFoundError as error:
        if not f"{module}.".startswith(f"{error.name}."):
            raise
        return None
    return found if isinstance(found, type) and is_dataclass(found) else None


@contextmanager
def by_excerpts() -> Iterator[None]:
    """Find the components of this package by excerpts of their modules, which import no library."""
    token = _BY_EXCERPTS.set(True)
    try:
        yield
    finally:
        _BY_EXCERPTS.reset(token)


def free_mappings(kind: type) -> set[str]:
    """Return the fields of a dataclass that are mappings of any keys."""
    return {name for name, hint in get_type_hints(kind).items() if get_origin(hint) is Mapping}


def construct(kind: type, values: Mapping[str, Any], where: str) -> Any:
    """Make a dataclass from plain values, each checked against its field's type.

    A field whose type is a dataclass is made from a mapping in the same way.

    Args:
        kind: The dataclass.
        values: By field.
        where: Its key, for messages; empty for what has none.

    Raises:
        ConfigError: With key, value and rule.
    """
    prefix = f"{where}." if where else ""
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where} must be a mapping, got {values!r}")
    hints = get_type_hints(kind)
    allowed = {each.name: each for each in fields(kind) if each.init}
    for key in values:
        if key not in allowed:
            has = f"it has {', '.join(allowed)}"
            hint = did_you_mean(f"{prefix}{key}", [f"{prefix}{name}" for name in allowed])
            raise ConfigError(f"{prefix}{key} is not a key of {where or kind.__name__}; {has}{hint}")
    for name, each in allowed.items():
        if name not in values and each.default is MISSING and each.default_factory is MISSING:
            raise ConfigError(f"{prefix}{name} must be given")
    try:
        return kind(**{key: _made(value, hints[key], key, prefix) for key, value in values.items()})
    except ValueError as error:
        message = str(error)
        raise ConfigError(message if message.startswith(prefix) else f"{prefix}{message}") from None


def _made(value: Any, hint: Any, key: str, prefix: str) -> Any:
    """Return a field's value in the form of its type hint."""
    if isinstance(hint, type) and is_dataclass(hint) and not isabstract(hint) and not is_dataclass(value):
        return construct(hint, value, f"{prefix}{key}")
    return fit(value, hint, key)


def chosen(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those values that are fields of a dataclass."""
    return {each.name: values[each.name] for each in fields(kind) if each.name in values}
