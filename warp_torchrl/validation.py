"""Validation of users' input: values against type hints and ranges, and names against known ones."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from difflib import SequenceMatcher, get_close_matches
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

_MOST = 2  # names that are offered
_LONGEST = 200  # characters of a name for which others are looked for


def check_fields(component: Any, **ranges: tuple[float, float]) -> None:
    """Check a dataclass's fields against their type hints and ranges.

    A value that fits a hint in another form takes the hint's: 3 becomes 3.0 where a float is due, a list a tuple.

    Args:
        component: A dataclass instance; it may be frozen.
        ranges: Lowest and highest value by field; a field that may be None is checked where it is not. Where a field
            may be a pair, from low to high, both ends are checked, and their order; of a mapping every value.

    Raises:
        ValueError: With the field, the rule and the value; NaN is in no range.
    """
    hints = get_type_hints(type(component))
    for name in (each.name for each in fields(component) if each.init):
        value = getattr(component, name)
        fitted = fit(value, hints[name], name)
        if fitted is not value:
            object.__setattr__(component, name, fitted)
        if name in ranges and fitted is not None:
            _check_range(name, fitted, *ranges[name])


def check_new_name(what: str, name: str, made: Any, known: Any) -> None:
    """Check that a name in a table belongs to no other module; the same module may define it again.

    Args:
        what: Content of the table, for the message.
        name: The name.
        made: The new object.
        known: The table's object of that name; None if there is none.

    Raises:
        ValueError: If another module has the name.
    """
    if known is not None and known.__module__ != made.__module__:
        raise ValueError(f"{name} must be a new {what}'s name, {known.__module__} has one")


def _check_range(name: str, value: Any, low: float, high: float) -> None:
    if isinstance(value, Mapping):
        for key, each in value.items():
            _check_range(f"{name}.{key}", each, low, high)
        return
    ends = value if isinstance(value, tuple) else (value,)
    if not all(low <= end <= high for end in ends):
        raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {value}")
    if not ends[0] <= ends[-1]:
        raise ValueError(f"{name} must be a pair from low to high, got {list(value)}")


def fit(value: object, hint: object, name: str) -> object:
    """Return a value in the form of a type hint; in a mapping each value in the form of the mapping's hint.

    Raises:
        ValueError: With the name, the kind of the hint and the value.
    """
    if get_origin(hint) is Mapping and isinstance(value, Mapping):
        return _fit_mapping(value, get_args(hint)[1], name)
    choices = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    for choice in choices:
        fits, fitted = _try_fit(value, choice)
        if fits:
            return fitted
    kinds = " or ".join(_describe(choice) for choice in choices)
    words = [str(word) for choice in choices if get_origin(choice) is Literal for word in get_args(choice)]
    raise ValueError(f"{name} must be {kinds}, got {value!r}{did_you_mean(value, words)}")


def _fit_mapping(value: Mapping[Any, object], hint: object, name: str) -> Mapping[Any, object]:
    fitted = {key: fit(each, hint, f"{name}.{key}") for key, each in value.items()}
    return value if all(fitted[key] is each for key, each in value.items()) else fitted


def _try_fit(value: object, hint: object) -> tuple[bool, object]:
    origin = get_origin(hint)
    if hint is Any:
        return True, value
    if hint in (None, NoneType):
        return value is None, None
    if origin is Literal:
        return value in get_args(hint) and not isinstance(value, bool), value
    if origin is tuple:
        return _try_fit_tuple(value, get_args(hint))
    if hint in (int, float):
        return _try_fit_number(value, hint)
    kind = origin or hint
    return isinstance(kind, type) and isinstance(value, kind), value


def _try_fit_number(value: object, kind: object) -> tuple[bool, object]:
    if isinstance(value, bool) or not isinstance(value, Real):
        return False, value
    if kind is float:
        try:
            return True, float(value)
        except OverflowError:  # a whole number of hundreds of digits
            return False, value
    if isinstance(value, Integral):
        return True, int(value)
    number = float(value)  # 1e6 is how many are written
    return number.is_integer(), int(number) if number.is_integer() else value


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


def closest_names(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names closest to a mistyped one, the likeliest first; none if none is close.

    The last part of a dotted key, ``algorithm.gama``, is first compared within its group, then with equal last parts
    elsewhere; then the whole key with all keys, and at last its last part with all last parts.
    """
    if len(name) > _LONGEST:
        return []
    known = list(dict.fromkeys(known))
    group, _, last = name.lower().rpartition(".")
    in_group = {_last(each): [each] for each in known if each.lower().rpartition(".")[0] == group}
    by_last: dict[str, list[str]] = {}
    for each in sorted(known, key=lambda key: -SequenceMatcher(None, name.lower(), key.lower()).ratio()):
        by_last.setdefault(_last(each), []).append(each)
    whole = {each.lower(): [each] for each in known}
    found = _close(last, in_group) or by_last.get(last) or _close(name.lower(), whole) or _close(last, by_last)
    return found[:_MOST]


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return the end of a message, ``: did you mean gamma?``; empty if no known name is near."""
    found = closest_names(str(name), known)
    return f": did you mean {' or '.join(found)}?" if found else ""


def _last(key: str) -> str:
    return key.lower().rpartition(".")[2]


def _close(name: str, named: dict[str, list[str]]) -> list[str]:
    """Return the values of the closest name."""
    return [each for close in get_close_matches(name, named, n=1, cutoff=0.65) for each in named[close]]


def dotted(node: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the leaves of nested mappings by dotted key: ``{"a": {"b": 1}}`` as ``a.b``.

    Args:
        node: The mapping.
        prefix: Of the keys.
    """
    found: dict[str, Any] = {}
    for key, value in node.items():
        found |= dotted(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found
