"""Tables in text files as spreadsheets and loggers write them: encodings, separators, decimal commas."""

import codecs
import csv
import io
import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from warp_torchrl.system.foreign import read_bytes

SEPARATORS = (",", ";", "\t", "|", " ")
"""What may stand between cells; a space stands for any number of them."""
_MOST_BYTES = 2**28
_MOST_COLUMNS = 1000
_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?", re.ASCII)
_COMMA = re.compile(r"([-+]?\d*),(\d+(?:[eE][-+]?\d{1,3})?)", re.ASCII)


def read_table_text(name: str, path: str | PathLike[str]) -> str:
    """Return the text of a file: UTF-8 or UTF-16 with or without a byte order mark, else Windows-1252.

    Args:
        name: What the file is, for messages.
        path: The file.

    Raises:
        ValueError: If it is no file that can be read, is larger than 256 MiB, or has NUL bytes.
    """
    wanted = f"{name} must be a CSV file that can be read, got {path}"
    try:
        content = read_bytes(Path(path), _MOST_BYTES)
    except (OSError, ValueError) as error:  # a NUL in a name is a ValueError
        raise ValueError(f"{wanted}: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = _decoded(content)
    except UnicodeDecodeError:
        raise ValueError(f"{wanted}: it is no text in UTF-8, UTF-16 or Windows-1252") from None
    text = text.rstrip("\x1a")  # ends files of old programs
    if "\0" in text:
        raise ValueError(f"{wanted}: it has NUL bytes")
    return text


def split_rows(text: str, separator: str, most: int | None = None) -> list[list[str]]:
    """Return the cells of each line without the spaces about them and control characters; a blank line has none.

    Args:
        text: The file's text.
        separator: One of ``SEPARATORS``.
        most: Lines to return; None returns all.

    Raises:
        ValueError: If quotes do not fit, or a line has more than a thousand cells.
    """
    lines = io.StringIO(text, newline="")
    if separator == " ":
        rows = [line.split() for line, _ in zip(lines, range(most or len(text) + 1), strict=False)]
    else:
        reader = csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)
        try:
            rows = [
                [cell.strip() for cell in row] for row, _ in zip(reader, range(most or len(text) + 1), strict=False)
            ]
        except csv.Error as error:
            raise ValueError(f"rows must be cells of a CSV file, {error} in line {reader.line_num}") from None
    for number, row in enumerate(rows, 1):
        if len(row) > _MOST_COLUMNS:
            raise ValueError(f"rows must have {_MOST_COLUMNS} cells at most, got {len(row)} in line {number}")
    return [[_printable(cell) for cell in row] if any(row) else [] for row in rows]


def named_separator(text: str) -> tuple[str | None, str]:
    """Return the separator that Excel's first line ``sep=;`` names, None without one, and the text below that line."""
    first, _, rest = text.partition("\n")
    named = re.fullmatch(r'"?sep=(.)"?,*', first.strip("\r\n "), re.IGNORECASE)
    named = named or re.fullmatch(r'"?sep=(\t)"?', first.strip("\r\n"), re.IGNORECASE)
    return (named[1], rest) if named and named[1] in SEPARATORS else (None, text)


def to_points(header: str, cells: Sequence[str], separator: str) -> list[str]:
    """Return the cells of a column, with decimal commas replaced by decimal points.

    Raises:
        ValueError: If the column has commas and points, or its commas may be those of thousands.
    """
    cells = [cell.replace("\N{MINUS SIGN}", "-") for cell in cells]
    commas = [cell for cell in cells if _COMMA.fullmatch(cell)]
    if not commas:
        return cells
    points = [cell for cell in cells if "." in cell and _NUMBER.fullmatch(cell)]
    if points:
        raise ValueError(f"{header} must have one decimal sign, got {commas[0]!r} and {points[0]!r}")
    if separator != ";" and all(re.fullmatch(r".*,\d{3}", cell) for cell in commas):
        raise ValueError(f"{header} must have decimal points, {commas[0]!r} may be thousands")
    return [_COMMA.sub(r"\1.\2", cell) if _COMMA.fullmatch(cell) else cell for cell in cells]


def to_number(cell: str) -> float | None:
    """Return the number in a cell with a decimal point; None where it holds none."""
    return float(cell) if _NUMBER.fullmatch(cell) else None


def _printable(cell: str) -> str:
    """Return a cell without what a terminal would obey, since messages name cells."""
    return cell if cell.isprintable() else "".join(each if each.isprintable() else " " for each in cell)


def _decoded(content: bytes) -> str:
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content[len(mark) :].decode(encoding)
    sample = content[:4096]
    for encoding, zeros in (("utf-16-le", sample[1::2]), ("utf-16-be", sample[::2])):
        if len(sample) > 1 and zeros.count(0) > 0.8 * len(zeros):
            return content.decode(encoding)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252")
