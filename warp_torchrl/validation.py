"""The one check that components make of their own fields."""

from dataclasses import fields
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from warp_torchrl.nearest import did_you_mean


def check_fields(component: Any, **ranges: tuple[float, float]) -> None:
    """Check a dataclass's fields: choices, whole numbers, and ranges.

    Args:
        component: A dataclass instance.
        ranges: Lowest and highest value by field; a field that may be None is checked where it is not. Where a field
            may be a pair, from low to high, both ends are checked, and their order.

    Raises:
        ValueError: With the field, the rule and the value; NaN is in no range.
    """
    hints = get_type_hints(type(component))
    for name in (each.name for each in fields(component) if each.init):
        value, hint = getattr(component, name), hints[name]
        kinds = set(get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,))
        if get_origin(hint) is Literal and (value not in get_args(hint) or isinstance(value, bool)):
            words = [str(word) for word in get_args(hint)]
            raise ValueError(f"{name} must be one of {', '.join(words)}, got {value}{did_you_mean(value, words)}")
        if value is None and NoneType in kinds:
            continue
        may_be_pair = name in ranges and any(get_origin(kind) is tuple for kind in kinds)
        is_pair = may_be_pair and isinstance(value, tuple | list)
        ends = value if is_pair else (value,)
        if is_pair and len(value) != 2:
            raise ValueError(f"{name} must be one number or a pair from low to high, got {list(value)}")
        is_whole = kinds - {NoneType} == {int} or (may_be_pair and float not in kinds)
        if is_whole and any(type(end) is not int for end in ends):
            raise ValueError(f"{name} must be a whole number, got {value!r}")
        if name in ranges:
            low, high = ranges[name]
            if not all(low <= end <= high for end in ends):
                raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {value}")
            if not ends[0] <= ends[-1]:
                raise ValueError(f"{name} must be a pair from low to high, got {list(value)}")
