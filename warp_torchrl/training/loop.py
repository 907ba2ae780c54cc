"""The one training loop. It names no algorithm: what differs between them is data of the learner."""

import logging
import time
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from tqdm import tqdm

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.collectors import WorkerDied
from warp_torchrl.config.compose import Record
from warp_torchrl.config.seeds import WORLDS, first_world_seed
from warp_torchrl.config.settings import Settings
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import REWARD, signature
from warp_torchrl.policy import MODES
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import disk, former
from warp_torchrl.runs.logging import MetricsFile, Tracker
from warp_torchrl.runs.saving import SaveClock, passes
from warp_torchrl.runs.transfer import learnt
from warp_torchrl.training.progress import TRAIN_COLUMNS, episode_columns, line, told_of_batches
from warp_torchrl.training.reward_scale import RewardScale
from warp_torchrl.training.signals import Noted, Stopped
from warp_torchrl.world.fast.compile import compile_function

log = logging.getLogger("warp_torchrl")
_SECONDS_BETWEEN_LINES = 15.0


class NumericalFailure(Exception):  # noqa: N818
    """A reward, a loss or a gradient is not finite; the weights were not touched."""


class Training:
    """A run: everything that moves, and how it is saved.

    Args:
        settings: What to train.
        record: The configuration as the run folder keeps it.
        run: The run folder.
    """

    def __init__(self, settings: Settings, record: Record, run: Path) -> None:
        torch.manual_seed(settings.seed)
        self.settings, self.record, self.run = settings, record, run
        first = first_world_seed(settings.seed)
        self.env = settings.make_training_env(settings.n_worlds, first)
        self.frames_per_batch = settings.collector.steps * settings.n_worlds
        learner = settings.algorithm.build(self.env, settings.model, self.frames_per_batch)
        if settings.compile:
            learner.terms = compile_function(learner.terms)
        self.learner: Learner = settings.imitation.taught(learner, self.env)
        self.reward_scale = RewardScale(settings.reward.gamma) if settings.reward.normalise else None
        self.collection = settings.collector.open(self.env, self.learner, settings.make_training_env, first)
        self.frames = 0
        self.seconds = 0.0
        self.saved_at = 0
        self.clock = SaveClock(settings.checkpoint.minutes, self._size)
        self.mode: str | None = None
        self.metrics = MetricsFile(run / "metrics.csv")
        self._scheduled = self.learner.schedule(0.0)

    def train(self) -> None:
        """Train until ``total_frames``, saving on the way and at the end.

        Raises:
            Stopped: By a signal, after saving.
            NumericalFailure: If a reward, loss or gradient is not finite.
        """
        with Noted() as signals:
            tracker = self.settings.logger.open(self.run)
            try:
                self._train(signals, tracker)
                self.mode = self.mode or self._better_mode()
                self.save()
                log.info("saved %d times, in %.2f %% of the time", self.clock.saves, 100.0 * self.clock.share())
            finally:
                tracker.close()  # after the last save: a server may keep it waiting
            if signals.received:
                raise Stopped(signals.received, self.run)

    def _train(self, signals: Noted, tracker: Tracker) -> None:
        total = self.settings.total_frames
        told = told_of_batches(total, self.settings.n_worlds, self.settings.collector.steps)
        if told is not None and self.frames < total:
            log.log(logging.WARNING if total < self.frames_per_batch else logging.INFO, told)
        bar = tqdm(total=total, initial=self.frames, unit="frame", disable=None, dynamic_ncols=True)
        start, next_line = time.perf_counter() - self.seconds, 0.0
        try:
            for batch in self._batches(signals) if self.frames < total else ():
                row = self._learn(batch)
                self.seconds = time.perf_counter() - start
                rate = batch.numel() / max(self.seconds - self._last_seconds, 1e-9)
                self._last_seconds = self.seconds
                row = {"time/frames": self.frames, "time/seconds": self.seconds, "time/fps": rate, **row}
                self.metrics.add(row)
                tracker.log(row, self.frames)
                bar.update(batch.numel())
                bar.set_postfix(saved=row["world/saved"], refresh=False)
                if bar.disable and (self.seconds >= next_line or self.frames >= total):
                    next_line = self.seconds + _SECONDS_BETWEEN_LINES
                    log.info(line(row, total))
                if self.frames >= total:
                    break
                if signals.received or self._is_regular(self.frames) or self.clock.is_due():
                    self.save()
                if signals.received:
                    raise Stopped(signals.received, self.run)
        finally:
            bar.close()

    _last_seconds = 0.0

    def _batches(self, signals: Noted) -> Iterator[TensorDictBase]:
        """Yield batches; where a worker dies, save first what was learnt."""
        try:
            yield from self.collection
        except WorkerDied:
            if self.frames > self.saved_at:
                self.save()
            if signals.received:  # which workers of the same terminal get too
                raise Stopped(signals.received, self.run) from None
            raise

    def _learn(self, batch: TensorDictBase) -> dict[str, float | None]:
        """Learn from one batch [B, T] and return the row of metrics."""
        learner = self.learner
        row = episode_columns(batch)
        if not batch["next", *REWARD].isfinite().all():
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
        self.frames += batch.numel()
        means = {name: float(value) / updates for name, value in sums.items()}
        row["train/loss"] = sum(means[key] for key in learner.loss_keys) if updates else None
        row |= dict.fromkeys(TRAIN_COLUMNS)
        row |= {column: means.get(key) for key, column in learner.columns.items()} | self._scheduled
        self._schedule()
        self.collection.refresh()
        row["evaluation/saved"] = self._evaluate(batch.numel())
        return row

    def _schedule(self) -> None:
        """Set what changes with progress; the columns that it gives belong to the next row."""
        self._scheduled = self.learner.schedule(min(1.0, self.frames / self.settings.total_frames))

    def tell_new_total(self, before: int) -> None:
        """Log what goes another way from here on than in a training of another length.

        Args:
            before: The ``total_frames`` that this training had.
        """
        old, total = self.learner.schedule(min(1.0, self.frames / before)), self.settings.total_frames
        self._schedule()
        changed = {name: (old[name], value) for name, value in self._scheduled.items() if value != old[name]}
        columns = ", ".join(f"{name} {was:.3g} -> {now:.3g}" for name, (was, now) in changed.items())
        log.info(
            "total_frames was %d and is %d: what changes over a training goes on as at %.1f %% of the new total%s",
            before, total, 100.0 * self.frames / total, f", {columns}" if columns else "",
        )  # fmt: skip

    def _update(self, sample: TensorDictBase) -> dict[str, Tensor]:
        """Take one optimiser step and return the loss's terms; nothing is read back from the device but finiteness."""
        learner = self.learner
        terms = learner.terms(sample)
        loss = sum(terms[key] for key in learner.loss_keys)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(learner.loss.parameters(), learner.max_grad_norm)
        if not torch.isfinite(norm + loss.detach()):  # one look at the device for both
            raise NumericalFailure(
                f"after {self.frames} frames the loss, {float(loss.detach()):g}, or its gradient, of norm "
                f"{float(norm):g}, is not finite; the weights were left as they were, and the last checkpoint stands"
            )
        learner.optimizer.step()
        learner.optimizer.zero_grad()
        learner.after_step(sample)
        wanted = {*learner.loss_keys, *learner.columns} & set(terms.keys())
        return {name: terms[name].detach().mean() for name in wanted}

    def _evaluate(self, frames: int) -> float | None:
        plan = self.settings.evaluation
        if not plan.interval or not passes(plan.interval, self.frames, frames):
            return None
        env = self.settings.make_env(plan.episodes, plan.first_seed)
        return float(play(env, self.learner.policy, plan.first_seed)["saved"].mean())

    def _better_mode(self) -> str:
        """Return how the policy does better on training seeds, sampled or deterministic."""
        chosen = self.settings.evaluation.mode
        if chosen != "best":
            return chosen
        first = first_world_seed(self.settings.seed)
        env = self.settings.make_env(min(self.settings.evaluation.episodes, WORLDS), first)
        saved = {mode: play(env, self.learner.policy, first, mode)["saved"].mean() for mode in MODES}
        return max(saved, key=saved.__getitem__)

    def save(self) -> Path:
        """Write a checkpoint of everything."""
        with self.clock.timed():
            self.metrics.sync()
            path = checkpoints.save(
                self.run,
                frames=self.frames,
                scenario=self.settings.scenario,
                signature=signature(self.env),
                mode=self.mode,
                record=self.record,
                policy=self.learner.policy.state_dict(),
                training=self.state_dict(),
                keep=self.settings.checkpoint.keep,
                stays=self._is_regular,
            )
        self.saved_at = self.frames
        return path

    def _size(self) -> int:
        """Return the bytes of the tensors that a checkpoint holds."""
        return disk.size(self.state_dict())

    def _is_regular(self, frames: int) -> bool:
        """Return whether a checkpoint of so many frames is one of the interval, whatever the clock does."""
        return passes(self.settings.checkpoint.interval, frames, self.frames_per_batch)

    def start_from(self, found: checkpoints.Checkpoint) -> None:
        """Begin with another run's networks, and their value normalisation, and with nothing else of it.

        Raises:
            CheckpointError: If it trained by another kind of loss or other networks.
        """
        loss = self.learner.loss
        loss.load_state_dict({**loss.state_dict(), **learnt(found, loss, self.settings.model)})

    def state_dict(self) -> dict[str, Any]:
        """Return everything that a run needs to go on exactly as if never stopped."""
        return {
            "loss": dict(self.learner.loss.state_dict()),
            "keeps": {name: each.state_dict() for name, each in self.learner.keeps.items()},
            "optimizer": self.learner.optimizer.state_dict(),
            "random": torch.get_rng_state(),
            "random_cuda": torch.cuda.get_rng_state(self.env.device) if self.env.device.type == "cuda" else None,
            "collection": self.collection.state_dict(),
            "reward_scale": {} if self.reward_scale is None else self.reward_scale.state_dict(),
            "frames": self.frames,
            "seconds": self.seconds,
            "rows": self.metrics.rows,
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
        except Exception as error:  # whatever a state that does not fit makes torch and TorchRL raise
            self._restore(before)
            if isinstance(error, OSError):
                raise
            reason = " ".join(str(error).split())
            raise checkpoints.CheckpointError(f"the checkpoint does not fit this configuration: {reason}") from None

    def _restore(self, state: Mapping[str, Any]) -> None:
        now = self.learner.loss.state_dict()
        loss = former.parameters(state["loss"], now)
        differing = now.keys() ^ loss.keys()
        if differing:  # tensordict loads what it is given by any names, and says that all were met
            raise ValueError(f"{min(differing)} is in one of the two alone")
        self.learner.loss.load_state_dict(loss)
        self.learner.optimizer.load_state_dict(state["optimizer"])
        for name, each in self.learner.keeps.items():
            each.load_state_dict(state["keeps"][name])
        self.collection.load_state_dict(state["collection"])
        if self.reward_scale is not None:
            self.reward_scale.load_state_dict(state["reward_scale"])
        self.frames, self.seconds = int(state["frames"]), float(state["seconds"])
        self.saved_at, self._last_seconds = self.frames, self.seconds
        self._schedule()
        torch.set_rng_state(state["random"])
        if state.get("random_cuda") is not None:
            torch.cuda.set_rng_state(state["random_cuda"], self.env.device)

    def close(self) -> None:
        """Shut the collector down."""
        self.collection.close()
