"""The one training loop for all algorithms: a run's folder, its rows and log, its checkpoints and its end.

Every process of a run goes through it with its share of the worlds; the first one alone logs, saves and decides.
"""

import logging
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from pathlib import Path
from typing import Any

from tensordict import TensorDictBase
from tqdm import tqdm

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.parallel import WorkerDied
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import signature
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.config.seeds import WORLDS, first_world_seed
from warp_torchrl.runs.logging import Tracker
from warp_torchrl.runs.metrics_file import MetricsFile
from warp_torchrl.runs.policies.trained import MODES
from warp_torchrl.runs.saving import SaveClock, passes
from warp_torchrl.system import disk
from warp_torchrl.system.finite import NumericalFailure, not_finite
from warp_torchrl.system.signals import DeferredSignals, Stopped
from warp_torchrl.training.learning import Learning
from warp_torchrl.training.progress import batch_size_notice, line

log = logging.getLogger("warp_torchrl")
_SECONDS_BETWEEN_LINES = 15.0


class Training(Learning):
    """A training run: collect, learn, log, save and resume.

    Args:
        run_config: What to train.
        saved_config: The configuration that checkpoints keep.
        run: The run folder, which the first process alone writes.
    """

    def __init__(self, run_config: RunConfig, saved_config: SavedConfig, run: Path) -> None:
        super().__init__(run_config)
        self.saved_config, self.run = saved_config, run
        self.is_first = parallel.rank() == 0
        self.seconds = 0.0
        self.saved_at = 0
        self.clock = SaveClock(run_config.checkpoint.minutes, self._size)
        self.mode: str | None = None
        self.metrics = MetricsFile(run / "metrics.csv")

    def train(self) -> None:
        """Train until ``total_frames``; save checkpoints on the way and at the end.

        Raises:
            Stopped: If a signal asked the run to stop; it has saved.
            NumericalFailure: If a reward, loss or gradient is not finite.
            WorkerDied: If a worker or another process ended; the run has saved.
        """
        with DeferredSignals() as signals:
            tracker = self._open_tracker() if self.is_first else None
            try:
                self.join()
                with self._bar() as bar:
                    self._train(signals, tracker, bar)
                if self.is_first:
                    self.mode = self.mode or self._better_mode()
                self.save()
                if self.is_first:
                    log.info("saved %d times, in %.2f %% of the time", self.clock.saves, 100.0 * self.clock.share())
            except WorkerDied:
                self._save_alone()
                if signals.received:  # a terminal sends its signals to the workers too
                    raise Stopped(signals.received, self.run) from None
                raise
            finally:
                if tracker is not None:
                    tracker.close()  # after the last save: a slow server may delay it
            if signals.received:
                raise Stopped(signals.received, self.run)

    def _open_tracker(self) -> Tracker:
        return self.run_config.logger.open(self.run, self.frames, self.metrics.cut_at)

    def _bar(self) -> AbstractContextManager[tqdm | None]:
        """Return the progress bar of the first process: it has a semaphore, which a killed process would leave."""
        total = self.run_config.total_frames
        if not self.is_first:
            return nullcontext()
        return tqdm(total=total, initial=self.frames, unit="frame", disable=None, dynamic_ncols=True)

    def _train(self, signals: DeferredSignals, tracker: Tracker | None, bar: tqdm | None) -> None:
        total = self.run_config.total_frames
        collector, worlds = self.collector, self.run_config.n_worlds
        end = collector.end(total, worlds)
        steps = collector.segment * self._segments
        notice = batch_size_notice(total, end, worlds, steps, "steps" if steps == collector.steps else "first_steps")
        if notice is not None and self.frames < total and self.is_first:
            log.log(logging.WARNING if total < self.frames_per_batch else logging.INFO, notice)
        self._began = time.perf_counter() - self.seconds
        for batches in self.batches() if self.frames < total else ():
            row = self._learn(batches)
            if tracker is not None and bar is not None:
                self._report(row, tracker, bar)
            if self.frames >= total:
                break
            due = signals.received or self._is_regular(self.frames) or self.clock.is_due()
            saves, received = self.go_on(bool(due), signals.received)
            if saves:
                self.save()
                _, received = self.go_on(received=signals.received)  # one may have come while it saved
            if received:
                raise Stopped(received, self.run)

    def go_on(self, saves: bool = False, received: int = 0) -> tuple[bool, int]:
        """Return in every process what the first one decides after a batch: whether to save, and a signal to stop at.

        Every process must call it after each batch but the last, and after a save.
        """
        return parallel.share((saves, received))

    _last_seconds = _next_line = 0.0

    def _report(self, row: dict[str, float | None], tracker: Tracker, bar: tqdm) -> None:
        """Write a row to ``metrics.csv``, the tracker, and the bar or the log."""
        total = self.run_config.total_frames
        self.seconds = time.perf_counter() - self._began
        rate = self.last_batch / max(self.seconds - self._last_seconds, 1e-9)
        self._last_seconds = self.seconds
        row = {"time/frames": self.frames, "time/seconds": self.seconds, "time/fps": rate, **row}
        self.metrics.add(row)
        tracker.log(row, self.frames)
        bar.update(self.last_batch)
        bar.set_postfix(saved=row["world/saved"], refresh=False)
        if bar.disable and (self.seconds >= self._next_line or self.frames >= total):
            self._next_line = self.seconds + _SECONDS_BETWEEN_LINES
            log.info(line(row, total))

    def _learn(self, batches: Sequence[TensorDictBase]) -> dict[str, float | None]:
        row = super()._learn(batches)
        return row | (self._evaluate() if self.is_first else {"evaluation/saved": None})

    def _save_alone(self) -> None:
        """Save without the processes that may have ended: on resume their worlds start new episodes."""
        if self.is_first and self.frames > self.saved_at:
            self._write(self.state_dict())

    def log_new_total(self, before: int) -> None:
        """Log the scheduled hyperparameters that change because ``total_frames`` was changed.

        Args:
            before: The former ``total_frames``.
        """
        old, total = self.learner.schedule(min(1.0, self.frames / before)), self.run_config.total_frames
        self._schedule()
        changed = {name: (old[name], value) for name, value in self._scheduled.items() if value != old[name]}
        columns = ", ".join(f"{name} {was:.3g} -> {now:.3g}" for name, (was, now) in changed.items())
        log.info(
            "total_frames was %d and is %d: what changes over a training goes on as at %.1f %% of the new total%s",
            before, total, 100.0 * self.frames / total, f", {columns}" if columns else "",
        )  # fmt: skip

    def _evaluate(self) -> dict[str, float | None]:
        """Return the columns of an evaluation on the way: the share saved, and of each kind if there are several."""
        options, kinds = self.run_config.evaluation, self.run_config.kinds
        names = ["saved"] if len(kinds) == 1 else ["saved", *(f"saved_{kind.name}" for kind in kinds)]
        if not options.interval or not passes(options.interval, self.frames, self.last_batch):
            return {f"evaluation/{name}": None for name in names}
        saved = []
        for kind in kinds:
            env = self.run_config.make_env(options.episodes, options.first_seed, world=kind.world)
            saved.append(float(play(env, self.learner.policy, options.first_seed)["saved"].mean()))
        values = saved if len(kinds) == 1 else [sum(saved) / len(saved), *saved]
        return {f"evaluation/{name}": value for name, value in zip(names, values, strict=True)}

    def _better_mode(self) -> str:
        """Return the mode, sampled or deterministic, that does better on training seeds, see ``goal``."""
        chosen = self.run_config.evaluation.mode
        if chosen != "best":
            return chosen
        first, kinds = first_world_seed(self.run_config.seed), self.run_config.kinds
        reached: dict[str, list[float]] = {mode: [] for mode in MODES}
        for kind in kinds:
            env = self.run_config.make_env(min(self.run_config.evaluation.episodes, WORLDS), first, world=kind.world)
            for mode, values in reached.items():
                values.append(float(play(env, self.learner.policy, first, mode)[goal(env.world)].mean()))
        better = max(reached, key=lambda mode: sum(reached[mode]))
        if len(kinds) > 1:
            told = ", ".join(f"{kind.name} {value:.3f}" for kind, value in zip(kinds, reached[better], strict=True))
            log.info("on training fires, %s, the team saves of each kind: %s", better, told)
        return better

    def save(self) -> Path | None:
        """Write a checkpoint and return its folder; every process must call it at once, and the first one writes."""
        others = parallel.gather({} if self.is_first else self._own())
        if not self.is_first:
            return None
        return self._write(self.state_dict() | ({"others": others[1:]} if len(others) > 1 else {}))

    def _write(self, training: Mapping[str, Any]) -> Path:
        policy = self.learner.policy.state_dict()
        for name, value in policy.items():
            if not_finite(value) is not None:
                raise NumericalFailure(
                    f"after {self.frames} frames {name} is not finite; it is not saved, and the last checkpoint stands"
                )
        with self.clock.timed():
            self.metrics.sync()
            path = checkpoints.save(
                self.run,
                frames=self.frames,
                scenario=self.run_config.scenario,
                signature=signature(self.env),
                mode=self.mode,
                saved_config=self.saved_config,
                policy=policy,
                training=training,
                keep=self.run_config.checkpoint.keep,
                stays=self._is_regular,
            )
        self.saved_at = self.frames
        return path

    def _size(self) -> int:
        """Return the size of a checkpoint's tensors [bytes], as if all processes had as much as this one."""
        return disk.tensors_size(self.state_dict()) + (parallel.size() - 1) * disk.tensors_size(self._own())

    def _is_regular(self, frames: int) -> bool:
        """Return whether a checkpoint is due at this number of frames, by ``checkpoint.interval``."""
        return passes(self.run_config.checkpoint.interval, frames, self.last_batch)

    def state_dict(self) -> dict[str, Any]:
        """Return everything that an exact resume needs of this process."""
        return {**super().state_dict(), "seconds": self.seconds, "rows": self.metrics.rows}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned, all or nothing.

        Raises:
            CheckpointError: If an entry does not fit this configuration.
            OSError: If the disk refuses to cut ``metrics.csv``.
        """
        before = deepcopy(self.state_dict())
        try:
            self._restore(state)
            self.metrics = MetricsFile(self.run / "metrics.csv", keep_rows=int(state["rows"]))
            self._others = state.get("others")
        except Exception as error:  # torch and TorchRL raise many types for a state that does not fit
            self._restore(before)
            if isinstance(error, OSError):
                raise
            reason = " ".join(str(error).split())
            raise checkpoints.CheckpointError(f"the checkpoint does not fit this configuration: {reason}") from None

    def _restore_shared(self, state: Mapping[str, Any]) -> None:
        super()._restore_shared(state)
        self.seconds = float(state["seconds"])
        self.saved_at, self._last_seconds = self.frames, self.seconds
