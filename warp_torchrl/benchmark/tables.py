"""Tables for the terminal."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

TableColumn = tuple[str, Callable[[Mapping[str, Any]], str]]
"""A heading, and a function from a row to its cell."""


def table(columns: Sequence[TableColumn], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows under headings, the first column left-aligned and the others right-aligned.

    A row with ``skipped`` stands below the others, with its reason.
    """
    shown = [row for row in rows if "skipped" not in row]
    lines = [[heading for heading, _ in columns], *([show(row) for _, show in columns] for row in shown)]
    widths = [max(len(line[index]) for line in lines) for index in range(len(columns))]
    text = [
        "  ".join(
            [line[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(line[1:], widths[1:]))]
        ).rstrip()
        for line in lines
    ]
    return "\n".join(text + [f"{row['what']} was skipped: {row['skipped']}" for row in rows if "skipped" in row])


def entry(heading: str, name: str | None = None, pattern: str = "{}") -> TableColumn:
    """Return a column of one entry, by default of its heading's name; empty where a row has none."""
    name = name or heading

    def show(row: Mapping[str, Any]) -> str:
        return "" if row.get(name) is None else pattern.format(row[name])

    return heading, show


def spread_of(pattern: str) -> TableColumn:
    """Return the column of the lowest and the highest value."""
    return "lowest .. highest", lambda row: f"{pattern} .. {pattern}".format(row["lowest"], row["highest"])
