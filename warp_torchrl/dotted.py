"""Nested mappings by dotted keys, as the command line names them."""

from collections.abc import Mapping
from typing import Any


def dotted(node: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return what stands in a mapping and in the mappings in it, by dotted key: ``{"a": {"b": 1}}`` as ``a.b``.

    Args:
        node: The mapping.
        prefix: Of the keys.
    """
    found: dict[str, Any] = {}
    for key, value in node.items():
        found |= dotted(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found
