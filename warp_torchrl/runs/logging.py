"""Trackers of runs, beside ``metrics.csv``: none, wandb or TensorBoard."""

import logging
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any, Literal, Protocol

from torchrl.record.loggers import get_logger

from warp_torchrl.system import disk
from warp_torchrl.validation import check_fields

log = logging.getLogger("warp_torchrl")
_ID = "wandb_id"  # a file of the run folder
_DIGITS = 8
_GIVEN = re.compile(rf"[0-9a-z]{{{_DIGITS}}}")


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
    """One of TorchRL's loggers; its first error ends the tracking, never the training.

    Args:
        name: Its name in TorchRL.
        run: The run folder.
        title: Name of the run; None takes the folder's name.
        sent_frames: Frames of the last row that the tracker has already.
        begin: Called with the new logger.
        options: Options of TorchRL's logger.
    """

    def __init__(
        self,
        name: str,
        run: Path,
        title: str | None = None,
        sent_frames: int = 0,
        begin: Callable[[Any], None] = lambda logger: None,
        **options: object,
    ) -> None:
        self._name, self._sent_frames = name, sent_frames
        try:
            self._logger = get_logger(name, str(run), title or run.name, **options)
            begin(self._logger)
        except Exception as error:
            self._fail(error)

    def log(self, row: Mapping[str, float | None], frames: int) -> None:
        """Send a row, with the column names of ``metrics.csv``."""
        if self._logger is None or frames <= self._sent_frames:
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

    def open(self, run: Path, frames: int = 0, sent_frames: int = 0) -> Tracker:
        """Return a tracker for a run folder, see ``Tensorboard.open``."""
        return _Silent()


@dataclass(frozen=True, kw_only=True)
class Wandb:
    """Weights & Biases. A resumed run continues its Weights & Biases run, whose number is in the run folder.

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

    def open(self, run: Path, frames: int = 0, sent_frames: int = 0) -> Tracker:
        """Return a tracker for a run folder, see ``Tensorboard.open``: rows that it has are not sent again."""
        os.environ.setdefault("WANDB_SILENT", "true")
        sweep = run.resolve().parent
        group = self.group or (sweep.name if (sweep / "multirun.yaml").exists() else None)
        number = _own_id(run / _ID, is_new=not frames)
        options = {"offline": self.mode == "offline", "project": self.project, "group": group, "id": number}
        return _TorchRlTracker("wandb", run, sent_frames=sent_frames, wandb_kwargs=options)


@dataclass(frozen=True, kw_only=True)
class Tensorboard:
    """TensorBoard; needs the extra ``tensorboard``."""

    def open(self, run: Path, frames: int = 0, sent_frames: int = 0) -> Tracker:
        """Return a tracker for a run folder.

        Args:
            run: The folder.
            frames: Frames of the checkpoint from which the run resumes; 0 for a new one.
            sent_frames: Frames of the last row that the run wrote before that; 0 if none is after the checkpoint.
        """
        before = sorted(path.parent.name for path in run.glob("*/*tfevents*"))

        def begin(logger: Any) -> None:
            if before:
                _drop_after(frames, logger.experiment)

        return _TorchRlTracker("tensorboard", run, before[0] if before else None, begin=begin)


def _drop_after(frames: int, writer: Any) -> None:
    """Let TensorBoard drop the points of a folder's earlier files after ``frames``."""
    from tensorboard.compat.proto.event_pb2 import Event, SessionLog

    start = SessionLog(status=SessionLog.START)
    writer.file_writer.add_event(Event(step=frames + 1, session_log=start))


def _own_id(path: Path, is_new: bool) -> str:
    """Return the number of a run in the tracker: for a resumed run the one in its folder, else a new one."""
    if path.is_file() and not is_new:
        with path.open("rb") as file:
            held = file.read(_DIGITS + 1).decode("ascii", errors="replace")
        if _GIVEN.fullmatch(held):
            return held
    made = token_hex(_DIGITS // 2)
    with suppress(OSError):  # a tracker never ends a training
        disk.replace(path, made)
    return made
