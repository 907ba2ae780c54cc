"""Renamed entries of saved files: old names, and the present ones."""

import re
from collections.abc import Mapping
from typing import Any

_SELF = re.compile(r"(^|[./])((?:canonical_(?:sent_)?)?)self(?=$|[./])")
"""``status`` was once called ``self``, also where it lies in canonical orientation, or late with the radio."""


def renamed(name: str) -> str:
    """Return the name that an entry has now; parts of a nested entry's name are joined by ``.`` or ``/``."""
    return _SELF.sub(r"\1\2status", name)


def with_renamed(content: Any) -> Any:
    """Return nested mappings and sequences whose mappings have the names of now; all else is as it is."""
    if isinstance(content, Mapping):
        return {renamed(key) if isinstance(key, str) else key: with_renamed(each) for key, each in content.items()}
    if type(content) in (list, tuple):
        return type(content)(map(with_renamed, content))
    return content
