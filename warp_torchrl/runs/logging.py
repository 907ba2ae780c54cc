"""Trackers of runs, beside ``metrics.csv``: none, wandb or TensorBoard."""

import json
import logging
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any, Literal, Protocol, cast

from PIL import Image

from warp_torchrl.system import disk
from warp_torchrl.validation import check_fields, dotted

log = logging.getLogger("warp_torchrl")
_ID = "wandb_id"  # a file of the run folder
_DIGITS = 8
_GIVEN = re.compile(rf"[0-9a-z]{{{_DIGITS}}}")


class Sink(Protocol):
    """An open run of a tracker."""

    def log(self, values: Mapping[str, float], frames: int) -> None:
        """Send values by name, all at once."""
        ...

    def show(self, table: str, rows: Sequence[Sequence[Any]], picture: Path | None, frames: int) -> None:
        """Send the table of the last evaluation, as text and as rows under a line of titles, and its picture."""
        ...

    def close(self) -> None:
        """Finish the run."""
        ...


class Tracker:
    """A callback that sends a run to a tracker, whose first error ends the tracking, never the training.

    Evaluations on the way are ``evaluation/<metric>``; the last one is ``final/<metric>``, with its table and picture.

    Args:
        name: Name of the tracker.
        open_sink: Opens the tracker's run.
        sent_frames: Frames of the last row that the tracker has already.
    """

    def __init__(self, name: str, open_sink: Callable[[], Sink], sent_frames: int = 0) -> None:
        self._name, self._sent_frames = name, sent_frames
        self._sink: Sink | None = None
        self._try(lambda: setattr(self, "_sink", open_sink()))

    def on_batch(self, training: Any, row: Mapping[str, float | None]) -> None:
        """Send a row, with the column names of ``metrics.csv``."""
        self._send({name: value for name, value in row.items() if value is not None}, training.frames)

    def on_evaluation(self, training: Any, result: Any) -> None:
        """Send the means of an evaluation's metrics; of the last one the table and the picture too."""
        several = len(training.run_config.kinds) > 1
        part, kind = ("evaluation", f"_{result.scenario}" if several else "") if not result.folder else ("final", "")
        means = {f"{part}/{name}{kind}": result.mean(name) for name in result.episodes}
        own = {f"evaluation/{name}{kind}" for name in ("saved", result.goal.name)}  # which ``metrics.csv`` has
        self._send({name: mean for name, mean in means.items() if mean == mean and name not in own}, training.frames)
        if result.folder and self._sink is not None:
            sink = self._sink
            self._try(lambda: sink.show(str(result), evaluation_rows(result.report), result.picture, training.frames))

    def on_end(self, training: Any) -> None:
        """Finish the tracker's run: a slow server may delay it."""
        if self._sink is not None:
            self._try(self._sink.close)

    def _send(self, values: Mapping[str, float], frames: int) -> None:
        if self._sink is not None and frames > self._sent_frames and values:
            sink = self._sink
            self._try(lambda: sink.log(values, frames))

    def _try(self, do: Callable[[], object]) -> None:
        try:
            do()
        except Exception as error:
            self._sink = None
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            log.warning("%s does not work, the run goes on without it: %s", self._name, reason)


def evaluation_rows(report: Mapping[str, Any]) -> list[list[Any]]:
    """Return a report's means as a line of titles and a line for each policy; None where one has no value."""
    policies = {**report["baselines"], **report["other_modes"], report["policy"]: report["metrics"]}
    names = list(dict.fromkeys(name for metrics in policies.values() for name in metrics))
    empty: dict[str, Any] = {"mean": None}
    lines = [[policy, *(each.get(name, empty)["mean"] for name in names)] for policy, each in policies.items()]
    return [["policy", *names], *lines]


class _WandbRun:
    """A run of Weights & Biases."""

    def __init__(self, run: Path, config: Mapping[str, Any], **options: Any) -> None:
        os.environ.setdefault("WANDB_SILENT", "true")
        import wandb

        self._wandb: Any = wandb
        self._run = wandb.init(dir=str(run), name=run.name, config=dict(config), **options)

    def log(self, values: Mapping[str, float], frames: int) -> None:
        self._run.log(dict(values), step=frames)

    def show(self, table: str, rows: Sequence[Sequence[Any]], picture: Path | None, frames: int) -> None:
        titles, *lines = rows
        shown: dict[str, Any] = {"final/table": self._wandb.Table(columns=list(titles), data=[list(x) for x in lines])}
        if picture is not None:
            is_page, wandb = picture.suffix == ".html", self._wandb
            shown["final/episode"] = wandb.Html(str(picture)) if is_page else wandb.Video(str(picture))
        self._run.log(shown, step=frames)

    def close(self) -> None:
        self._run.finish()


class _TensorboardEvents:
    """A file of events of TensorBoard."""

    def __init__(self, folder: Path, config: Mapping[str, Any], drop_after: int | None) -> None:
        from torch.utils.tensorboard import SummaryWriter
        from torch.utils.tensorboard.summary import hparams

        self._writer = cast(Any, SummaryWriter(str(folder)))
        if drop_after is not None:
            _drop_after(drop_after, self._writer)
            return
        self._writer.add_text("config", f"```\n{json.dumps(config, indent=1)}\n```")
        values = {
            key: value if isinstance(value, (bool, int, float, str)) else json.dumps(value)
            for key, value in dotted(config).items()
        }
        for summary in hparams(values, {"final/saved": 0.0}):
            self._writer.file_writer.add_summary(summary)

    def log(self, values: Mapping[str, float], frames: int) -> None:
        from tensorboard.compat.proto.summary_pb2 import Summary

        points = [Summary.Value(tag=name, simple_value=value) for name, value in values.items()]
        self._writer.file_writer.add_summary(Summary(value=points), frames)

    def show(self, table: str, rows: Sequence[Sequence[Any]], picture: Path | None, frames: int) -> None:
        from tensorboard.compat.proto.summary_pb2 import Summary

        self._writer.add_text("final/table", f"```\n{table}\n```", frames)
        if picture is not None and picture.suffix == ".gif":
            with Image.open(picture) as first:
                width, height = first.size
            gif = Summary.Image(encoded_image_string=picture.read_bytes(), width=width, height=height, colorspace=3)
            self._writer.file_writer.add_summary(Summary(value=[Summary.Value(tag="final/episode", image=gif)]), frames)

    def close(self) -> None:
        self._writer.close()


@dataclass(frozen=True, kw_only=True)
class CsvOnly:
    """No tracker; a run always writes ``metrics.csv``."""

    def open(self, run: Path, frames: int, sent_frames: int, config: Mapping[str, Any]) -> Tracker | None:
        """Return no tracker, see ``Tensorboard.open``."""
        return None


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

    def open(self, run: Path, frames: int, sent_frames: int, config: Mapping[str, Any]) -> Tracker:
        """Return a tracker for a run folder, see ``Tensorboard.open``: rows that it has are not sent again."""
        sweep = run.resolve().parent
        group = self.group or (sweep.name if (sweep / "multirun.yaml").exists() else None)
        number = _own_id(run / _ID, is_new=not frames)
        options = {"project": self.project, "mode": self.mode, "group": group, "id": number}
        options |= {"resume": "allow"} if self.mode == "online" else {}  # offline its number joins the parts
        return Tracker("wandb", lambda: _WandbRun(run, config, **options), sent_frames)


@dataclass(frozen=True, kw_only=True)
class Tensorboard:
    """TensorBoard; needs the extra ``tensorboard``."""

    def open(self, run: Path, frames: int, sent_frames: int, config: Mapping[str, Any]) -> Tracker:
        """Return a tracker for a run folder.

        Args:
            run: The folder.
            frames: Frames of the checkpoint from which the run resumes; 0 for a new one.
            sent_frames: Frames of the last row that the run wrote before that; 0 if none is after the checkpoint.
            config: The run's configuration, as plain values.
        """
        before = sorted(path.parent for path in run.glob("*/*tfevents*"))
        folder, drop_after = (before[0], frames) if before else (run / run.name, None)
        return Tracker("tensorboard", lambda: _TensorboardEvents(folder, config, drop_after))


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
