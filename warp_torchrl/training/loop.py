"""The one training loop for all algorithms: a run's folder, its rows and log, its checkpoints and its end.

Every process of a run goes through it with its share of the worlds; the first one alone logs, saves and decides.
"""

import logging
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from typing import Any

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.parallel import WorkerDied
from warp_torchrl.evaluation.goal import better_of, goal
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import signature
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.config.seeds import WORLDS
from warp_torchrl.runs.history import History, Stage, stage_of, with_steps
from warp_torchrl.runs.metrics_file import MetricsFile
from warp_torchrl.runs.policies.teachers import teachers_of
from warp_torchrl.runs.policies.trained import MODES
from warp_torchrl.runs.saving import SaveClock, passes
from warp_torchrl.system import disk
from warp_torchrl.system.finite import NumericalFailure, not_finite
from warp_torchrl.system.signals import DeferredSignals, Stopped
from warp_torchrl.training.callbacks import Callbacks
from warp_torchrl.training.evaluations import EvaluationsOnTheWay
from warp_torchrl.training.learning import Learning
from warp_torchrl.training.progress import ProgressBar, batch_size_notice

log = logging.getLogger("warp_torchrl")


class Training(Learning):
    """A training run: collect, learn, log, save and resume.

    Args:
        run_config: What to train.
        saved_config: The configuration that checkpoints keep.
        run: The run folder, which the first process alone writes.
        callbacks: Objects with some of ``HOOKS``; the first process calls them.

    Raises:
        ValueError: If a callback has no hook.
    """

    def __init__(
        self, run_config: RunConfig, saved_config: SavedConfig, run: Path, callbacks: Sequence[object] = ()
    ) -> None:
        self._given, self.callbacks = callbacks, Callbacks(callbacks)
        super().__init__(run_config)
        self.saved_config, self.run = saved_config, run
        self.is_first = parallel.rank() == 0
        self.before: History = ()
        """History of what it starts from."""
        self.seconds = 0.0
        self.saved_at = 0
        self.clock = SaveClock(run_config.checkpoint.minutes, self._size)
        self.mode: str | None = None
        self.metrics = MetricsFile(run / "metrics.csv")
        self._stops = False

    def train(self, signals: DeferredSignals | None = None) -> None:
        """Train until ``total_frames``; save checkpoints on the way and at the end. ``end`` closes the callbacks.

        Args:
            signals: Those that stop the run, for a command; None leaves signals to the caller.

        Raises:
            Stopped: If a signal asked the run to stop; it has saved.
            NumericalFailure: If a reward, loss or gradient is not finite.
            WorkerDied: If a worker or another process ended; the run has saved.
        """
        signals = signals or DeferredSignals()  # which records nothing before it is entered
        self.callbacks = self._opened()
        try:
            self.join()
            self._train(signals)
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
        if signals.received:
            raise Stopped(signals.received, self.run)

    def stop(self) -> None:
        """Let the training end after this batch, as if it had reached ``total_frames``; for callbacks."""
        self._stops = True

    def end(self) -> None:
        """Call ``on_end`` of the callbacks; they are called no more."""
        callbacks, self.callbacks = self.callbacks, Callbacks()
        callbacks.end(self)

    def _opened(self) -> Callbacks:
        """Return the callbacks of the first process; the bar's semaphore would stay behind of a killed other one."""
        if not self.is_first:
            return Callbacks()
        config = self.run_config
        tracker = config.logger.open(self.run, self.frames, self.metrics.cut_at, self.saved_config.values)
        bar = ProgressBar(config.total_frames, self.frames)
        trackers = [] if tracker is None else [tracker]
        return Callbacks([EvaluationsOnTheWay(config), *self._given, self.metrics, *trackers, bar])

    def _train(self, signals: DeferredSignals) -> None:
        total = self.run_config.total_frames
        collector, worlds = self.collector, self.run_config.n_worlds
        end = collector.end(total, worlds)
        steps = collector.segment * self._segments
        notice = batch_size_notice(total, end, worlds, steps, "steps" if steps == collector.steps else "first_steps")
        if notice is not None and self.frames < total and self.is_first:
            log.log(logging.WARNING if total < self.frames_per_batch else logging.INFO, notice)
        self._began = time.perf_counter() - self.seconds
        for batches in self.batches() if self.frames < total else ():
            self._report(self._learn(batches))
            if self.frames >= total:
                break
            due = signals.received or self._is_regular(self.frames) or self.clock.is_due()
            saves, received, stops = self.go_on(bool(due), signals.received, self._stops)
            if stops:
                break
            if saves:
                self.save()
                _, received, _ = self.go_on(received=signals.received)  # one may have come while it saved
            if received:
                raise Stopped(received, self.run)

    def go_on(self, saves: bool = False, received: int = 0, stops: bool = False) -> tuple[bool, int, bool]:
        """Return in every process what the first one decides after a batch: to save, a signal to stop at, to end.

        Every process must call it after each batch but the last, and after a save.
        """
        return parallel.share((saves, received, stops))

    _last_seconds = 0.0

    def _report(self, row: Mapping[str, float | None]) -> None:
        """Give a row to the callbacks, with its times."""
        self.seconds = time.perf_counter() - self._began
        rate = self.last_batch / max(self.seconds - self._last_seconds, 1e-9)
        self._last_seconds = self.seconds
        times = {"time/frames": self.frames, "time/seconds": self.seconds, "time/fps": rate}
        self.callbacks.call("on_batch", self, {**times, **row})

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

    def _better_mode(self) -> str:
        """Return the mode, sampled or deterministic, that does better on training seeds, see ``goal``."""
        chosen = self.run_config.evaluation.mode
        if chosen != "best":
            return chosen
        first, kinds = self.run_config.first_seed, self.run_config.kinds
        reached: dict[str, list[float]] = {mode: [] for mode in MODES}
        aims = [goal(kind.world) for kind in kinds]
        for kind, aim in zip(kinds, aims, strict=True):
            env = self.run_config.make_env(min(self.run_config.evaluation.episodes, WORLDS), first, world=kind.world)
            for mode, values in reached.items():
                values.append(float(play(env, self.learner.policy, first, mode)[aim.name].mean()))
        better = better_of(reached, aims)
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
                history=self.history,
            )
        self.saved_at = self.frames
        self.callbacks.call("on_checkpoint", self, path)
        return path

    @property
    def history(self) -> History:
        """Return the trainings behind the policy as it is now, this one last."""
        return (*self.before, with_steps(self._stage, self.frames, round(self.seconds / 60.0, 2)))

    @cached_property
    def _stage(self) -> Stage:
        """Return this training's stage at its start."""
        values = self.saved_config.values
        scenario, teachers = self.run_config.scenario, teachers_of(values)
        return stage_of(self.saved_config.choices, values, scenario, self.before, teachers)

    def start_from(self, found: checkpoints.Checkpoint) -> None:
        """Load another run's networks, see ``Learning.start_from``, and take its history.

        Raises:
            CheckpointError: If that run had another kind of loss or other networks.
        """
        super().start_from(found)
        self.before = found.history

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
