"""The table of a run's metrics, ``metrics.csv``."""

import csv
import io
import logging
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path

from warp_torchrl.system import disk
from warp_torchrl.system.foreign import open_file

log = logging.getLogger("warp_torchrl")
FRAMES = "time/frames"
"""The column that says after how many frames a row was written."""
_LARGEST = 1_000_000_000  # bytes of a metrics.csv


class MetricsFile:
    """``metrics.csv``: one row for each iteration, complete after a crash, truncated on resume.

    The first row sets the columns, and the first row of a resumed run may add some: of a plugin that measures more now,
    say. A missing value is an empty cell, so that earlier rows have empty cells there.

    Args:
        path: The file.
        keep_rows: Rows to keep on resume; the others were written after the checkpoint.

    Attributes:
        cut_at: Frames of the last of those others; 0 if there are none.

    Raises:
        ValueError: If the file has fewer rows.
    """

    def __init__(self, path: Path, keep_rows: int = 0) -> None:
        self.path = path
        self.rows = keep_rows
        self.cut_at = 0
        self._columns: list[str] | None = None
        self._may_widen = keep_rows > 0
        if keep_rows:
            self._columns = self._cut(keep_rows)

    def on_batch(self, training: object, row: Mapping[str, float | None]) -> None:
        """Append the row of a batch: the file is a callback of its training."""
        self.add(row)

    def add(self, row: Mapping[str, float | None]) -> None:
        """Append a row. ``sync`` flushes it to the disk.

        Raises:
            ValueError: If a column is new, and the row not the first.
            OSError: If the write fails.
        """
        lines = []
        if self._columns is None:
            self._columns = list(row)
            lines.append(self._columns)
        elif new := [column for column in row if column not in self._columns]:
            if not self._may_widen:
                raise ValueError(f"metrics.csv has no columns {sorted(new)}")
            self._widen(new)
        self._may_widen = False
        values = [row.get(column) for column in self._columns]
        lines.append(["" if value is None else repr(value) for value in values])
        mode = "w" if len(lines) > 1 else "a"
        with disk.with_path(self.path), self.path.open(mode, newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(lines)
        self.rows += 1

    def sync(self) -> None:
        """Flush every row to the disk."""
        if self.rows:
            disk.sync(self.path)

    def _widen(self, new: list[str]) -> None:
        """Add columns to the file, empty in the rows that it has."""
        log.info("%s: the resumed run adds the columns %s", self.path, ", ".join(new))
        with self.path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        self._columns = header + new
        self._replace([self._columns, *(row + [""] * len(new) for row in rows)])

    def _replace(self, lines: Iterable[Sequence[str]]) -> None:
        table = io.StringIO(newline="")
        csv.writer(table).writerows(lines)
        disk.replace(self.path, table.getvalue())

    def _cut(self, rows: int) -> list[str]:
        """Truncate the file to its first rows, and return the columns."""
        lines = []
        if self.path.exists():
            opened = open_file(self.path, _LARGEST)
            with io.TextIOWrapper(opened, encoding="utf-8", errors="replace", newline="") as file:  # a crash may cut it
                try:
                    lines = list(islice(csv.reader(file), rows + 1))
                    self.cut_at = _last_frames(lines[:1], csv.reader(file))
                except csv.Error as error:
                    raise ValueError(f"{self.path} is no table of metrics: {error}") from None
        if lines and FRAMES not in lines[0]:
            raise ValueError(f"{self.path} is no table of metrics: it has no column {FRAMES}")
        if len(lines) <= rows:
            raise ValueError(f"{self.path} must hold the {rows} rows of the checkpoint, got {max(len(lines) - 1, 0)}")
        self._replace(lines)
        return lines[0]


def _last_frames(header: Sequence[Sequence[str]], rows: Iterable[Sequence[str]]) -> int:
    """Return the frames of the last row that is written to its end; 0 if there is none."""
    whole = [row for row in rows if header and len(row) == len(header[0])]
    place = header[0].index(FRAMES) if whole and FRAMES in header[0] else None
    return 0 if place is None or not whole[-1][place].isdigit() else int(whole[-1][place])
