"""Provenance of input data: columns and bands read from each file, their units, and those ignored.

Readers of files report here; a command collects the reports of its files.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

from warp_torchrl.system.foreign_text import plain_text

_MOST_NAMES = 40
_name, _text = partial(plain_text, most=123), partial(plain_text, most=4000)  # [characters]
_log = logging.getLogger("warp_torchrl")


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Report on one file that was read.

    Attributes:
        key: What the file is to us, by its configuration key: ``weather``, ``landscape.elevation``.
        file: The file, or a layer or band of it.
        read: The unit and meaning of each column, band or property that was read, by its name in the file:
            ``{"WS": "wind_speed, km/h"}``.
        left: Names of the columns, bands or properties that were not read.
        notes: Other facts that change what the values mean, a sentence each.
    """

    key: str
    file: str
    read: Mapping[str, str] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """Return the report in one line."""
        read = [_name(name) + (f" [{_text(unit)}]" if unit else "") for name, unit in self.read.items()]
        taken = [f"read {_listed(read)}"] if read or not self.notes else []
        left = [f"left {_listed([_name(name) for name in self.left])}"] if self.left else []
        return f"{self.key}: {_text(self.file)}: " + "; ".join([*taken, *left, *map(_text, self.notes)])

    @property
    def as_values(self) -> dict[str, Any]:
        """Return the report as plain values."""
        return {
            "key": self.key,
            "file": self.file,
            "read": dict(self.read),
            "left": list(self.left),
            "notes": list(self.notes),
        }

    @classmethod
    def of_values(cls, values: Mapping[str, Any]) -> "Provenance":
        """Return the report of plain values from ``as_values``."""
        return cls(**{**values, "left": tuple(values["left"]), "notes": tuple(values["notes"])})


_gathered: ContextVar[list[Provenance] | None] = ContextVar("gathered", default=None)


def report_file(provenance: Provenance) -> None:
    """Report a file that was read: to ``gathered`` blocks, and in one line of the log, once per process."""
    gathering = _gathered.get()
    if gathering is not None and provenance not in gathering:
        gathering.append(provenance)
    _log_once(provenance.line)


@contextmanager
def gathered() -> Iterator[list[Provenance]]:
    """Yield a list that receives every report in the block, each file once."""
    found: list[Provenance] = []
    token = _gathered.set(found)
    try:
        yield found
    finally:
        _gathered.reset(token)


def section(files: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines of a report in Markdown about some files, given as ``Provenance.as_values``; none for none."""
    if not files:
        return []
    return ["", "Files that were read:", "", *(f"- {_inert(Provenance.of_values(each).line)}" for each in files)]


@cache
def _log_once(line: str) -> None:
    _log.info("%s", line)


def _listed(names: list[str]) -> str:
    if not names:
        return "nothing"
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _inert(text: str) -> str:
    """Return a line of Markdown in which a file's names make neither HTML nor links."""
    return text.replace("<", "&lt;").replace("](", "] (")
