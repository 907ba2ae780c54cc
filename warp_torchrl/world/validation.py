"""The one check that components make of their own fields."""

from dataclasses import fields
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints


def check_fields(component: Any, **ranges: tuple[float, float]) -> None:
    """Check a dataclass's fields: choices, whole numbers, and ranges.

    Args:
        component: A dataclass instance.
        ranges: Lowest and highest value by field; a field that may be None is checked where it is not.

    Raises:
        ValueError: With the field, the rule and the value; NaN is in no range.
    """
    hints = get_type_hints(type(component))
    for name in (each.name for each in fields(component)):
        value, hint = getattr(component, name), hints[name]
        kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
        if get_origin(hint) is Literal and value not in get_args(hint):
            raise ValueError(f"{name} must be one of {', '.join(map(str, get_args(hint)))}, got {value}")
        if value is None and type(None) in kinds:
            continue
        if int in kinds and len(set(kinds) - {type(None)}) == 1 and type(value) is not int:
            raise ValueError(f"{name} must be a whole number, got {value!r}")
        if name in ranges and not ranges[name][0] <= value <= ranges[name][1]:
            low, high = ranges[name]
            raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {value}")
