"""Loggers: ``metrics.csv`` always, and a tracker if chosen."""

import csv
import io
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal, Protocol

from torchrl.record.loggers import get_logger

from warp_torchrl.runs import disk
from warp_torchrl.validation import check_fields

log = logging.getLogger("warp_torchrl")


class MetricsFile:
    """``metrics.csv``: one row for each iteration, complete after a crash, truncated on resume.

    The first row sets the columns; a resumed run of a former version goes on with those that it has. A missing value is
    an empty cell.

    Args:
        path: The file.
        keep_rows: Rows to keep on resume; the others were written after the checkpoint.

    Raises:
        ValueError: If the file has fewer rows.
    """

    def __init__(self, path: Path, keep_rows: int = 0) -> None:
        self.path = path
        self.rows = keep_rows
        self._columns: list[str] | None = None
        self._is_resumed = keep_rows > 0
        if keep_rows:
            self._columns = self._cut(keep_rows)

    def add(self, row: Mapping[str, float | None]) -> None:
        """Append a row. ``sync`` flushes it to the disk.

        Raises:
            ValueError: If a column is new to the file that this run has begun.
            OSError: If the write fails.
        """
        lines = []
        if self._columns is None:
            self._columns = list(row)
            lines.append(self._columns)
        unknown = set(row) - set(self._columns)
        if unknown and not self._is_resumed:
            raise ValueError(f"metrics.csv has no columns {sorted(unknown)}")
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

    def _cut(self, rows: int) -> list[str]:
        """Truncate the file to its first rows, and return the columns."""
        lines = []
        if self.path.exists():
            with self.path.open(newline="", encoding="utf-8", errors="replace") as file:  # a crash may cut the last row
                lines = list(islice(csv.reader(file), rows + 1))
        if len(lines) <= rows:
            raise ValueError(f"{self.path} must hold the {rows} rows of the checkpoint, got {max(len(lines) - 1, 0)}")
        kept = io.StringIO(newline="")
        csv.writer(kept).writerows(lines)
        disk.replace(self.path, kept.getvalue())
        return lines[0]


class Tracker(Protocol):
    """A tracker of a run's metrics."""

    def log(self, row: Mapping[str, float | None], frames: int) -> None:
        """Send a row."""
        ...

    def close(self) -> None:
        """Finish the tracker's run."""
        ...


class _Silent:
    def log(self, row: Mapping[str, float | None], frames: int) -> None:
        """Send nothing."""

    def close(self) -> None:
        """Do nothing."""


class _TorchRlTracker:
    """One of TorchRL's loggers; its first error ends the tracking, never the training."""

    def __init__(self, name: str, run: Path, **options: object) -> None:
        self._name = name
        try:
            self._logger = get_logger(name, str(run), run.name, **options)
        except Exception as error:
            self._fail(error)

    def log(self, row: Mapping[str, float | None], frames: int) -> None:
        """Send a row, with the column names of ``metrics.csv``."""
        if self._logger is None:
            return
        try:
            for name, value in row.items():
                if value is not None:
                    self._logger.log_scalar(name, value, step=frames)
        except Exception as error:
            self._fail(error)

    def close(self) -> None:
        """Finish the tracker's run."""
        experiment = getattr(self._logger, "experiment", None)
        finish = getattr(experiment, "finish", None) or getattr(experiment, "close", None)
        try:
            if finish is not None:
                finish()
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._logger = None
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        log.warning("%s does not work, the run goes on without it: %s", self._name, reason)


@dataclass(frozen=True, kw_only=True)
class CsvOnly:
    """No tracker; a run always writes ``metrics.csv``."""

    def open(self, run: Path) -> Tracker:
        """Return a tracker for a run folder."""
        return _Silent()


@dataclass(frozen=True, kw_only=True)
class Wandb:
    """Weights & Biases.

    Attributes:
        project: Name of the project.
        mode: ``offline`` writes into the run folder, to sync later; ``online`` sends.
        group: Name of the group; null groups the runs of a sweep under the name of its folder.
    """

    project: str = "warp_torchrl"
    mode: Literal["offline", "online"] = "offline"
    group: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def open(self, run: Path) -> Tracker:
        """Return a tracker for a run folder."""
        os.environ.setdefault("WANDB_SILENT", "true")
        sweep = run.resolve().parent
        group = self.group or (sweep.name if (sweep / "multirun.yaml").exists() else None)
        options = {"offline": self.mode == "offline", "project": self.project, "group": group}
        return _TorchRlTracker("wandb", run, wandb_kwargs=options)


@dataclass(frozen=True, kw_only=True)
class Tensorboard:
    """TensorBoard; needs the extra ``tensorboard``."""

    def open(self, run: Path) -> Tracker:
        """Return a tracker for a run folder."""
        return _TorchRlTracker("tensorboard", run)
