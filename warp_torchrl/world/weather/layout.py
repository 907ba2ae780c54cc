"""Layout of a weather file: preamble, header, row of units, rows."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from warp_torchrl.system.delimited import SEPARATORS, named_separator, read_table_text, split_rows, to_number
from warp_torchrl.world.weather.columns import read_column_header
from warp_torchrl.world.weather.stations import read_station
from warp_torchrl.world.weather.units import unit_of

_TOP = 200
"""Lines among which the names of the columns are looked for."""


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A table of texts.

    Attributes:
        headers: Names of the columns.
        rows: Cells, as many in each row as there are headers.
        below: Units in a row below the headers; empty where there is none.
        separator: What stands between cells.
        zone: Hours that its clock is ahead of UTC, where the file says so.
        left: What of the file was left unread beside columns.
        height: Height of the wind, where the kind of file says it.
        calm_at_zero: Whether a bearing of 0 says that there is no direction.
    """

    headers: list[str]
    rows: list[list[str]]
    below: list[str]
    separator: str = ","
    zone: float | None = None
    left: tuple[str, ...] = ()
    height: str | None = None
    calm_at_zero: bool = False


def read_sheet(path: Path) -> Sheet:
    """Return the table in a file of weather.

    Read are CSV files with any of ``delimited.SEPARATORS``; FARSITE's weather streams and winds (.wxs, .wnd); and the
    fixed columns of WIMS (FW13, FW9).

    Raises:
        ValueError: If it cannot be read, has no header or row, or a row has other cells than the header.
    """
    text = read_table_text("weather", path)
    try:
        if station := read_station(text):
            return Sheet(**station)
        return _read_table(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _read_table(text: str) -> Sheet:
    named, text = named_separator(text)
    separator, top = _find_header(text, named)
    table = split_rows(text, separator)
    headers = _uncommented(table[top]) if table else []
    while headers and not headers[-1]:
        headers.pop()
    body, left = _body(table[top + 1 :], headers)
    below, body = _units_below(headers, body)
    if not headers or not body:
        lines = sum(1 for row in table if row)
        raise ValueError(f"weather must have a header and a row, got {lines} lines")
    for number, row in enumerate(body, 1):
        if len(row) != len(headers):
            raise ValueError(f"rows must have {len(headers)} cells as the header, got {len(row)} in row {number}")
    about = [row for row in table[:top] if row]
    told = [f"{len(about)} lines above the header"] if about else []
    return Sheet(headers=headers, rows=body, below=below, separator=separator, zone=_zone(about), left=(*told, *left))


def _find_header(text: str, named: str | None) -> tuple[str, int]:
    """Return the separator, and the line that names the most quantities by it; of equal ones the longest table's."""
    best, place = (0, 0, 0, 0), (",", 0)
    for rank, separator in enumerate([named] if named else SEPARATORS):
        try:
            rows = split_rows(text, separator, _TOP)
        except ValueError:
            continue
        for line, row in enumerate(rows):
            cells = _uncommented(row)
            found = len({head.quantity for cell in cells if cell and (head := read_column_header(cell)).quantity})
            length = next((k for k, below in enumerate(rows[line:]) if not below), len(rows) - line)
            if found and (score := (found, length, len(cells), -rank)) > best:
                best, place = score, (separator, line)
    if best[0]:
        return place
    separator = named or max(SEPARATORS[:-1], key=text.partition("\n")[0].count)
    rows = split_rows(text, separator, _TOP)
    return separator, next((line for line, row in enumerate(rows) if row and not row[0].startswith("#")), 0)


def _uncommented(row: Sequence[str]) -> list[str]:
    """Return the cells of a row without the # of a comment before the first."""
    return [row[0].lstrip("#").strip(), *row[1:]] if row else []


def _body(table: Sequence[list[str]], headers: Sequence[str]) -> tuple[list[list[str]], list[str]]:
    """Return the rows until another table begins, and a note on the rest."""
    rows: list[list[str]] = []
    for number, row in enumerate(table):
        if not row or row[0].startswith("#") or row == [*headers]:
            continue
        if row[0].startswith("[$]"):  # ends files of the Bureau of Meteorology
            break
        if rows and _is_header(row, follows=table[number - 1]):
            return rows, [f"a second table of {sum(1 for each in table[number:] if each) - 1} rows"]
        while len(row) > len(headers) and not row[-1]:
            row = row[:-1]
        rows.append(row)
    return rows, []


def _is_header(row: Sequence[str], follows: Sequence[str]) -> bool:
    """Return whether a row names the columns of another table: words alone, two of quantities or below a blank line."""
    if len(row) < 2 or any(to_number(cell) is not None for cell in row):
        return False
    if not follows and not re.search(r"\d", row[0]):
        return True
    return sum(read_column_header(cell).quantity is not None for cell in row if cell) > 1


def _units_below(headers: Sequence[str], rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Return the units of a first row that names them, and the other rows; loggers add one of how values were made."""
    if not rows or len(rows[0]) != len(headers):
        return [], rows
    words = [word for word in rows[0] if word]
    if any(to_number(word) is not None for word in words) or not any(unit_of(word) for word in words):
        return [], rows
    rest = rows[1:]
    if rest and {word.lower() for word in rest[0] if word} <= {"avg", "smp", "tot", "max", "min", "wvc", "std"}:
        rest = rest[1:]
    return rows[0], rest


def _zone(about: Sequence[Sequence[str]]) -> float | None:
    """Return the hours ahead of UTC that Open-Meteo writes above its table."""
    for names, values in pairwise(about):
        if "utc_offset_seconds" in names and len(values) == len(names):
            seconds = to_number(values[names.index("utc_offset_seconds")])
            return None if seconds is None else seconds / 3600.0
    return None


def zone_of(header: str) -> float | None:
    """Return the hours ahead of UTC that a header states, as in "Date Time, GMT-07:00" or "HORA (UTC)"."""
    found = re.search(
        r"(?<![a-z])(?:utc|gmt)(?![a-z])\s*(?:([+-])(\d{1,2}):?(\d\d)?)?", header.lower().replace("_", " ")
    )
    if not found:
        return None
    hours = float(found[2] or 0) + float(found[3] or 0) / 60.0
    return -hours if found[1] == "-" else hours
