"""Builds components from plain configuration nodes: types, unknown keys and the components' own rules.

A node names its class, one of this package's dataclasses, in ``_target_``; nothing else is ever imported by name.
"""

import importlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from warp_torchrl.nearest import did_you_mean


class ConfigError(ValueError):
    """A mistake in the configuration, told in one line with key, value and rule."""


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
        node: A mapping with ``_target_``, one of this package's dataclasses, and its fields.
        where: The node's key, for messages.

    Raises:
        ConfigError: If the target is not ours, a key is unknown, or a value breaks a rule.
    """
    if not isinstance(node, Mapping) or "_target_" not in node:
        raise ConfigError(f"{where} must name one of the files of conf/{where}, got {node!r}")
    target = str(node["_target_"])
    module, _, name = target.rpartition(".")
    component = None
    if re.fullmatch(r"warp_torchrl(\.\w+)+", target):
        try:
            component = getattr(importlib.import_module(module), name, None)
        except ImportError:
            component = None
    if not (isinstance(component, type) and is_dataclass(component)):
        raise ConfigError(f"{where}._target_ must be a component of warp_torchrl, got {target}")
    return construct(component, {key: value for key, value in node.items() if key != "_target_"}, where)


def construct(component: type, values: Mapping[str, Any], where: str) -> Any:
    """Make a dataclass from plain values, each checked against its field's type.

    Raises:
        ConfigError: With key, value and rule.
    """
    prefix = f"{where}." if where else ""
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where} must be a mapping, got {values!r}")
    hints = get_type_hints(component)
    allowed = {each.name: each for each in fields(component) if each.init}
    for key in values:
        if key not in allowed:
            has = f"it has {', '.join(allowed)}"
            hint = did_you_mean(f"{prefix}{key}", [f"{prefix}{name}" for name in allowed])
            raise ConfigError(f"{prefix}{key} is not a key of {where or component.__name__}; {has}{hint}")
    for name, each in allowed.items():
        if name not in values and each.default is MISSING and each.default_factory is MISSING:
            raise ConfigError(f"{prefix}{name} must be given")
    fitted = {key: _fit(value, hints[key], f"{prefix}{key}") for key, value in values.items()}
    try:
        return component(**fitted)
    except ValueError as error:
        message = str(error)
        raise ConfigError(message if message.startswith(prefix) else f"{prefix}{message}") from None


def _fit(value: object, hint: object, key: str) -> object:
    """Return a value as its field's type wants it."""
    choices = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    for choice in choices:
        fits, fitted = _try_fit(value, choice)
        if fits:
            return fitted
    names = " or ".join(_describe(choice) for choice in choices)
    words = [str(word) for choice in choices if get_origin(choice) is Literal for word in get_args(choice)]
    raise ConfigError(f"{key} must be {names}, got {value!r}{did_you_mean(value, words)}")


def _try_fit(value: object, hint: object) -> tuple[bool, object]:
    origin = get_origin(hint)
    if hint is Any or origin is Any:
        return True, value
    if hint in (None, NoneType):
        return value is None, None
    if origin is Literal:
        return value in get_args(hint), value
    if origin is tuple:
        return _try_fit_tuple(value, get_args(hint))
    if hint is bool:
        return isinstance(value, bool), value
    if hint is int:
        whole = int(value) if isinstance(value, float) and value.is_integer() else value  # 1e6 is how many are written
        return isinstance(whole, int) and not isinstance(whole, bool), whole
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return False, value
        return True, float(value)
    kind = origin or hint
    return isinstance(kind, type) and isinstance(value, kind), value


def _try_fit_tuple(value: object, items: tuple[object, ...]) -> tuple[bool, object]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        return False, value
    kinds = [items[0]] * len(value) if items[-1] is Ellipsis else list(items)
    if len(kinds) != len(value):
        return False, value
    fitted = [_try_fit(each, kind) for each, kind in zip(value, kinds, strict=True)]
    return all(fits for fits, _ in fitted), tuple(each for _, each in fitted)


def _describe(hint: object) -> str:
    origin = get_origin(hint)
    if hint in (None, NoneType):
        return "null"
    if origin is Literal:
        return " or ".join(str(choice) for choice in get_args(hint))
    if origin is tuple:
        items = get_args(hint)
        return f"a list of {_describe(items[0])}" if items[-1] is Ellipsis else f"a list of {len(items)} values"
    if origin is Mapping:
        return "a mapping"
    names: dict[object, str] = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}
    return names.get(hint, getattr(hint, "__name__", str(hint)))
