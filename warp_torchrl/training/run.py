"""A run: training, or its resumption, and the evaluation at its end, in a run folder."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.algorithms import parallel
from warp_torchrl.evaluation.evaluate import evaluate_policy
from warp_torchrl.evaluation.result import Result
from warp_torchrl.evaluation.runs.folders import read_metrics
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import as_yaml, plain, without_targets
from warp_torchrl.runs.config.saved_config import SavedConfig, restore, world_overrides
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.load import load_policy
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.runs.resumption import Resumption, is_run_of, resumption
from warp_torchrl.system import disk
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.system.signals import DeferredSignals, Stopped
from warp_torchrl.training.checks import Build
from warp_torchrl.training.following import FOLLOWING
from warp_torchrl.training.loop import Training

log = logging.getLogger("warp_torchrl")
_NOT_RECORDED = ("resume", "debug", "policy", "hydra")


@dataclass(frozen=True, kw_only=True)
class Run:
    """A training that has ended.

    Attributes:
        folder: Its folder: checkpoints, ``metrics.csv``, ``evaluation.json``, ``episode.gif``.
        frames: World steps that it was trained.
        result: Its evaluation; None where nothing was left to train.
    """

    folder: Path
    frames: int
    result: Result | None = None

    def policy(self, mode: str = "best") -> TrainedPolicy:
        """Return the trained policy; see ``load_policy``."""
        return load_policy(self.folder, mode)

    def metrics(self) -> dict[str, np.ndarray]:
        """Return the columns of ``metrics.csv``, float64 [batches] each, NaN where a batch has no value."""
        return read_metrics(self.folder / "metrics.csv")


def train_composed(
    config: Any,
    options: Mapping[str, str],
    folder: Path,
    *,
    build: Build,
    total_frames: Any = None,
    callbacks: Sequence[object] = (),
    signals: AbstractContextManager[DeferredSignals] | None = None,
    is_job: bool = False,
) -> Run:
    """Train what was composed and checked, evaluate it, and return the run; resume where the folder holds this run.

    Args:
        config: Composed by Hydra.
        options: Option of each group.
        folder: The run folder.
        build: Builds the configuration of plain values.
        total_frames: New total of a resumed run; None leaves it.
        callbacks: Objects with some of ``HOOKS``.
        signals: Entered while it trains: the signals that let it save and stop.
        is_job: Whether it is a job of a sweep, whose finished runs stay when the sweep is repeated.

    Raises:
        ConfigError: If the folder holds another run or an evaluation, or this run is finished and is no job.
    """
    lock = RunFolderLock(folder)
    work = _Work(folder, build, callbacks, signals or nullcontext(DeferredSignals()))
    try:
        with nullcontext() if config.debug else _quiet():
            if config.resume is not None:
                return work.resume(resumption(folder, total_frames, build))
            if checkpoints.holds_any(folder):
                return work.resume(_begun(folder, config, build, is_job))
            return work.start(config, options)
    finally:
        lock.release()


@dataclass(frozen=True)
class _Work:
    """A training and its evaluation in a folder."""

    folder: Path
    build: Build
    callbacks: Sequence[object]
    signals: AbstractContextManager[DeferredSignals]

    def start(self, config: Any, options: Mapping[str, str]) -> Run:
        folder = self.folder
        if (folder / "evaluation.json").exists():
            raise ConfigError(f"{folder} holds an evaluation, which training would replace; take another folder")
        run_config = self.build(plain(config)).settled()
        config.processes = run_config.processes
        disk.replace(folder / "config.yaml", as_yaml(config))
        values = {key: value for key, value in without_targets(plain(config)).items() if key not in _NOT_RECORDED}
        saved_config = SavedConfig(choices=dict(options), values=values)
        with parallel.processes(run_config.n_processes(), plain(config), FOLLOWING):
            training = Training(run_config, saved_config, folder, self.callbacks)
            if config.start_from is not None:
                training.start_from(newest(find_policy(config.start_from)))
            self._train(training)
        return self._evaluated(training, world_overrides(plain(config)))

    def resume(self, run: Resumption) -> Run:
        say_skipped(run.skipped)
        if run.is_finished:
            log.info("%s is finished; total_frames=MORE trains it longer", self.folder)
            return Run(folder=self.folder, frames=run.found.manifest.frames)
        with parallel.processes(run.run_config.n_processes(), run.values, FOLLOWING):
            training = Training(run.run_config, run.saved_config, self.folder, self.callbacks)
            training.load_state_dict(run.found.training())
            training.before = run.found.history[:-1]
            log.info("resumed %s at %d frames", run.found.path, training.frames)
            if run.run_config.total_frames != run.total_before:
                # Before the next checkpoint: a run that is killed now must resume with the new total too.
                disk.replace(self.folder / "config.yaml", as_yaml(restore(run.saved_config)))
                training.log_new_total(run.total_before)
            self._train(training)
        return self._evaluated(training, world_overrides(run.values))

    def _train(self, training: Training) -> None:
        try:
            with self.signals as signals:
                training.train(signals)
            if signals.received:  # since it looked for the last time
                raise Stopped(signals.received, self.folder)
        except BaseException:
            training.end()
            raise
        finally:
            training.close()

    def _evaluated(self, training: Training, worlds: Sequence[str]) -> Run:
        try:
            found = checkpoints.newest(self.folder)[0]
            result = evaluate_policy(training.run_config, self.folder, found, worlds)
            training.callbacks.call("on_evaluation", training, result)
        finally:
            training.end()
        return Run(folder=self.folder, frames=training.frames, result=result)


def _begun(folder: Path, config: Any, build: Build, is_job: bool) -> Resumption:
    """Return how the run of this very configuration resumes: a queue that has stopped a job starts it again alike.

    Raises:
        ConfigError: If the folder holds another run, or this one is finished and is no job of a sweep.
    """
    run = resumption(folder, build=build) if is_run_of(folder, as_yaml(config)) else None
    if run is None or (run.is_finished and not is_job):
        raise ConfigError(f"{folder} holds a run already; go on with resume={folder}, or take another folder")
    return run


def newest(path: str | Path) -> checkpoints.Checkpoint:
    """Return the newest sound checkpoint, and log the skipped ones."""
    found, skipped = checkpoints.newest(path)
    say_skipped(skipped)
    return found


def say_skipped(skipped: Sequence[str]) -> None:
    """Log the unsound checkpoints that were skipped."""
    for line in skipped:
        log.warning("skipped: %s", line)


@contextmanager
def _quiet() -> Iterator[None]:
    """Let TorchRL log warnings alone: it prints a line for each of its buffers."""
    logger = logging.getLogger("torchrl")
    before = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(before)
