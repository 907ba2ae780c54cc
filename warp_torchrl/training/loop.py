"""The one training loop for all algorithms; what differs between them is a field of ``Learner``.

Every process of a run goes through it with its share of the worlds; the first one alone logs, saves and decides.
"""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from tqdm import tqdm

from warp_torchrl import parallel
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.config.compose import SavedConfig
from warp_torchrl.config.run_config import RunConfig
from warp_torchrl.config.seeds import WORLDS, first_world_seed
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import signature
from warp_torchrl.parallel import WorkerDied
from warp_torchrl.policy import MODES
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import disk, former
from warp_torchrl.runs.logging import MetricsFile, Tracker
from warp_torchrl.runs.saving import SaveClock, passes
from warp_torchrl.runs.transfer import learned_parameters
from warp_torchrl.training.finite import FiniteSteps, NumericalFailure
from warp_torchrl.training.progress import TRAIN_COLUMNS, batch_size_notice, episode_columns, line
from warp_torchrl.training.recorded import RecordedUpdate
from warp_torchrl.training.reward_scale import RewardScale
from warp_torchrl.training.signals import DeferredSignals, Stopped
from warp_torchrl.world.fast.compile import compile_function

log = logging.getLogger("warp_torchrl")
_SECONDS_BETWEEN_LINES = 15.0


class Training:
    """A training run: collect, learn, log, save and resume.

    Args:
        run_config: What to train.
        record: The configuration that checkpoints keep.
        run: The run folder, which the first process alone writes.
    """

    def __init__(self, run_config: RunConfig, record: SavedConfig, run: Path) -> None:
        torch.manual_seed(run_config.seed)  # the same in every process: all begin with the same networks
        self.run_config, self.record, self.run = run_config, record, run
        self.is_first = parallel.rank() == 0
        worlds = run_config.n_worlds // parallel.size()
        first = first_world_seed(run_config.seed) + worlds * parallel.rank()
        self.env = run_config.make_training_env(worlds, first)
        learner = run_config.algorithm.build(self.env, run_config.model, run_config.collector.steps * worlds)
        if run_config.compile:
            learner.terms = compile_function(learner.terms)
        self.learner: Learner = run_config.imitation.kickstart(learner, self.env)
        self._steps = FiniteSteps(self.learner.optimizer)
        if run_config.graph:
            self._update = RecordedUpdate(self._update, self.learner.optimizer)  # type: ignore[method-assign]
        self.reward_scale = RewardScale(run_config.reward.gamma) if run_config.reward.normalise else None
        self.collection = run_config.collector.open(self.env, self.learner, run_config.make_training_env, first)
        self.frames = 0
        self.seconds = 0.0
        self.saved_at = 0
        self.clock = SaveClock(run_config.checkpoint.minutes, self._size)
        self.mode: str | None = None
        self.metrics = MetricsFile(run / "metrics.csv")
        self._scheduled = self.learner.schedule(0.0)
        self._segments = self._segments_now()
        self._others: list[dict[str, Any]] | None = None
        """What a checkpoint holds of the other processes."""
        if not self.is_first:
            torch.manual_seed(_seed_of_process(run_config.seed, parallel.rank()))

    def train(self) -> None:
        """Train until ``total_frames``; save checkpoints on the way and at the end.

        Raises:
            Stopped: If a signal asked the run to stop; it has saved.
            NumericalFailure: If a reward, loss or gradient is not finite.
            WorkerDied: If a worker or another process ended; the run has saved.
        """
        with DeferredSignals() as signals:
            tracker = self.run_config.logger.open(self.run) if self.is_first else None
            try:
                self._join()
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

    def _bar(self) -> AbstractContextManager[tqdm | None]:
        """Return the progress bar of the first process: it has a semaphore, which a killed process would leave."""
        total = self.run_config.total_frames
        if not self.is_first:
            return nullcontext()
        return tqdm(total=total, initial=self.frames, unit="frame", disable=None, dynamic_ncols=True)

    def _train(self, signals: DeferredSignals, tracker: Tracker | None, bar: tqdm | None) -> None:
        total = self.run_config.total_frames
        notice = batch_size_notice(total, self.run_config.n_worlds, self.run_config.collector.steps)
        if notice is not None and self.frames < total and self.is_first:
            log.log(logging.WARNING if total < self.frames_per_batch else logging.INFO, notice)
        self._began = time.perf_counter() - self.seconds
        for batch in self._batches() if self.frames < total else ():
            row = self._learn(batch)
            if tracker is not None and bar is not None:
                self._report(row, tracker, bar)
            if self.frames >= total:
                break
            due = signals.received or self._is_regular(self.frames) or self.clock.is_due()
            saves, received = parallel.share((bool(due), signals.received))
            if saves:
                self.save()
            if received:
                raise Stopped(received, self.run)

    _last_seconds = _next_line = 0.0
    _last_frames = 0

    @property
    def frames_per_batch(self) -> int:
        """Return the frames of the current batch, of all processes."""
        return self.run_config.n_worlds * self.run_config.collector.segment * self._segments

    def _segments_now(self) -> int:
        """Return of how many segments the next batch consists."""
        grows = self.learner.batches_grow and not self.run_config.graph  # a graph has one size
        progress = min(1.0, self.frames / self.run_config.total_frames) if grows else 1.0
        return self.run_config.collector.segments(progress)

    def _batches(self) -> Iterator[TensorDictBase]:
        """Yield batches [B, T] of so many segments as are due."""
        held: list[TensorDictBase] = []
        for segment in self.collection:
            held.append(segment if self._segments == 1 else segment.clone())  # the collector writes over it
            if len(held) >= self._segments:
                yield held[0] if len(held) == 1 else torch.cat(held, dim=1)
                held = []

    def _report(self, row: dict[str, float | None], tracker: Tracker, bar: tqdm) -> None:
        """Write a row to ``metrics.csv``, the tracker, and the bar or the log."""
        total = self.run_config.total_frames
        self.seconds = time.perf_counter() - self._began
        frames = self.frames - self._last_frames
        rate = frames / max(self.seconds - self._last_seconds, 1e-9)
        self._last_seconds, self._last_frames = self.seconds, self.frames
        row = {"time/frames": self.frames, "time/seconds": self.seconds, "time/fps": rate, **row}
        self.metrics.add(row)
        tracker.log(row, self.frames)
        bar.update(frames)
        bar.set_postfix(saved=row["world/saved"], refresh=False)
        if bar.disable and (self.seconds >= self._next_line or self.frames >= total):
            self._next_line = self.seconds + _SECONDS_BETWEEN_LINES
            log.info(line(row, total))

    def _save_alone(self) -> None:
        """Save without the processes that may have ended: on resume their worlds start new episodes."""
        if self.is_first and self.frames > self.saved_at:
            self._write(self.state_dict())

    def _join(self) -> None:
        """Give the other processes what the first one begins with, or has resumed."""
        if parallel.size() == 1:
            return
        begun = parallel.share({**self.state_dict(), "others": self._others} if self.is_first else None)
        if self.is_first:
            return
        self._restore_shared(begun)
        if begun["others"] is not None:
            self._restore_own(begun["others"][parallel.rank() - 1])
        elif self.frames:  # saved when this process had ended
            self.collection.start_anew(self.frames // self.run_config.n_worlds)

    def _learn(self, batch: TensorDictBase) -> dict[str, float | None]:
        """Learn from one batch [B, T] and return its row of ``metrics.csv``."""
        learner = self.learner
        row, unsound = episode_columns(batch)
        if unsound:
            raise NumericalFailure(f"after {self.frames} frames a reward is not finite; the last checkpoint stands")
        if self.reward_scale is not None:
            self.reward_scale(batch)
        learner.store(batch)
        sums: dict[str, Tensor] = {}
        updates = 0
        for sample in learner.samples():
            for name, value in self._update(sample).items():
                sums[name] = sums.get(name, 0.0) + value
            updates += 1
        if updates:
            parallel.mean_(sums[name] for name in sorted(sums))
        means = {name: value / updates for name, value in self._steps.read(sums, self.frames).items()}
        self.frames += self.frames_per_batch
        row["train/loss"] = sum(means[key] for key in learner.loss_keys) if updates else None
        row |= dict.fromkeys(TRAIN_COLUMNS)
        row |= {column: means.get(key) for key, column in learner.columns.items()} | self._scheduled
        row["evaluation/saved"] = self._evaluate() if self.is_first else None
        self._schedule()
        self.collection.refresh()
        return row

    def _schedule(self) -> None:
        """Update the scheduled hyperparameters; their columns belong to the next row."""
        self._scheduled = self.learner.schedule(min(1.0, self.frames / self.run_config.total_frames))
        self._segments = self._segments_now()

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

    def _update(self, sample: TensorDictBase) -> dict[str, Tensor]:
        """Take one optimiser step and return the loss terms."""
        learner = self.learner
        terms = learner.terms(sample)
        loss = sum(terms[key] for key in learner.loss_keys)
        loss.backward()
        trained = [each.grad for each in learner.loss.parameters() if each.grad is not None]
        parallel.mean_([*trained, total := loss.detach().clone()])
        norm = torch.nn.utils.clip_grad_norm_(learner.loss.parameters(), learner.max_grad_norm)
        self._steps.take(total, norm, self.frames)
        learner.optimizer.zero_grad()
        learner.after_step(sample)
        wanted = {*learner.loss_keys, *learner.columns} & set(terms.keys())
        return {name: terms[name].detach().mean() for name in wanted}

    def _evaluate(self) -> float | None:
        plan = self.run_config.evaluation
        if not plan.interval or not passes(plan.interval, self.frames, self.frames_per_batch):
            return None
        env = self.run_config.make_env(plan.episodes, plan.first_seed)
        return float(play(env, self.learner.policy, plan.first_seed)["saved"].mean())

    def _better_mode(self) -> str:
        """Return the mode, sampled or deterministic, that saves more on training seeds."""
        chosen = self.run_config.evaluation.mode
        if chosen != "best":
            return chosen
        first = first_world_seed(self.run_config.seed)
        env = self.run_config.make_env(min(self.run_config.evaluation.episodes, WORLDS), first)
        saved = {mode: play(env, self.learner.policy, first, mode)["saved"].mean() for mode in MODES}
        return max(saved, key=saved.__getitem__)

    def save(self) -> Path | None:
        """Write a checkpoint and return its folder; every process must call it at once, and the first one writes."""
        others = parallel.gather({} if self.is_first else self._own())
        if not self.is_first:
            return None
        return self._write(self.state_dict() | ({"others": others[1:]} if len(others) > 1 else {}))

    def _write(self, training: Mapping[str, Any]) -> Path:
        with self.clock.timed():
            self.metrics.sync()
            path = checkpoints.save(
                self.run,
                frames=self.frames,
                scenario=self.run_config.scenario,
                signature=signature(self.env),
                mode=self.mode,
                record=self.record,
                policy=self.learner.policy.state_dict(),
                training=training,
                keep=self.run_config.checkpoint.keep,
                stays=self._is_regular,
            )
        self.saved_at = self.frames
        return path

    def _size(self) -> int:
        """Return the size of a checkpoint's tensors [bytes], as if all processes had as much as this one."""
        return disk.size(self.state_dict()) + (parallel.size() - 1) * disk.size(self._own())

    def _is_regular(self, frames: int) -> bool:
        """Return whether ``checkpoint.interval`` asks for a checkpoint at this number of frames."""
        return passes(self.run_config.checkpoint.interval, frames, self.frames_per_batch)

    def start_from(self, found: checkpoints.Checkpoint) -> None:
        """Load another run's networks and value normalisation; everything else starts anew.

        Raises:
            CheckpointError: If that run had another kind of loss or other networks.
        """
        loss = self.learner.loss
        loss.load_state_dict({**loss.state_dict(), **learned_parameters(found, loss)})

    def state_dict(self) -> dict[str, Any]:
        """Return everything that an exact resume needs of this process."""
        return {
            "loss": dict(self.learner.loss.state_dict()),
            "optimizer": self.learner.optimizer.state_dict(),
            **self._own(),
            "frames": self.frames,
            "seconds": self.seconds,
            "rows": self.metrics.rows,
        }

    def _own(self) -> dict[str, Any]:
        """Return what differs from process to process."""
        return {
            "keeps": {name: each.state_dict() for name, each in self.learner.keeps.items()},
            "random": torch.get_rng_state(),
            "random_cuda": torch.cuda.get_rng_state(self.env.device) if self.env.device.type == "cuda" else None,
            "collection": self.collection.state_dict(),
            "reward_scale": {} if self.reward_scale is None else self.reward_scale.state_dict(),
        }

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

    def _restore(self, state: Mapping[str, Any]) -> None:
        self._restore_shared(state)
        self._restore_own(state)

    def _restore_shared(self, state: Mapping[str, Any]) -> None:
        now = self.learner.loss.state_dict()
        loss = former.parameters(state["loss"], now)
        differing = now.keys() ^ loss.keys()
        if differing:  # tensordict does not report missing or unexpected names
            raise ValueError(f"{min(differing)} is in one of the two alone")
        self.learner.loss.load_state_dict(loss)
        self.learner.optimizer.load_state_dict(state["optimizer"])
        self.frames, self.seconds = int(state["frames"]), float(state["seconds"])
        self.saved_at, self._last_frames, self._last_seconds = self.frames, self.frames, self.seconds
        self._schedule()

    def _restore_own(self, state: Mapping[str, Any]) -> None:
        for name, each in self.learner.keeps.items():
            each.load_state_dict(state["keeps"][name])
        self.collection.load_state_dict(state["collection"])
        if self.reward_scale is not None:
            self.reward_scale.load_state_dict(state["reward_scale"])
        torch.set_rng_state(state["random"])
        if state.get("random_cuda") is not None:
            torch.cuda.set_rng_state(state["random_cuda"], self.env.device)

    def close(self) -> None:
        """Shut the collector down."""
        self.collection.close()


def _seed_of_process(seed: int, rank: int) -> int:
    """Return the seed of a process's draws, of actions and of minibatches."""
    return (seed + 2**40 * rank) % 2**64
