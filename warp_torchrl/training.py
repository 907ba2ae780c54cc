"""The one training loop. It names no algorithm: what differs between them is data of the learner."""

import logging
import signal
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from tqdm import tqdm

from warp_torchrl import checkpoint as checkpoints
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collectors import WorkerDied
from warp_torchrl.config import Record
from warp_torchrl.env import EPISODE_METRICS
from warp_torchrl.evaluation import MODES, play
from warp_torchrl.logging import MetricsFile
from warp_torchrl.models import signature
from warp_torchrl.reward_scale import RewardScale
from warp_torchrl.settings import TRAINING_SEEDS, Settings

log = logging.getLogger("warp_torchrl")
_SECONDS_BETWEEN_LINES = 15.0
TRAIN_COLUMNS = (
    "train/policy_gradient_loss",
    "train/value_loss",
    "train/entropy_loss",
    "train/approx_kl",
    "train/clip_fraction",
    "train/clip_range",
    "train/explained_variance",
    "train/learning_rate",
)
"""Columns of ``metrics.csv`` that every run has; empty where an algorithm has no value for them."""


class NumericalFailure(Exception):  # noqa: N818
    """A loss or a gradient is not finite; the weights were not touched."""


class Stopped(Exception):  # noqa: N818
    """A signal asked the run to stop; it has saved.

    Attributes:
        number: The signal's.
    """

    def __init__(self, number: int, run: Path) -> None:
        super().__init__(f"stopped by signal {signal.Signals(number).name}; go on with resume={run}")
        self.number = number


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
        self.env = settings.make_env(settings.n_worlds, TRAINING_SEEDS * settings.seed)
        self.frames_per_batch = settings.collector.steps * settings.n_worlds
        self.learner: Learner = settings.algorithm.build(self.env, settings.model, self.frames_per_batch)
        self.reward_scale = RewardScale(settings.reward.gamma) if settings.reward.normalise else None
        self.collection = settings.collector.open(
            self.env, self.learner, settings.make_env, TRAINING_SEEDS * settings.seed
        )
        self.frames = 0
        self.seconds = 0.0
        self.saved_at = 0
        self.mode: str | None = None
        self.metrics = MetricsFile(run / "metrics.csv")
        self._scheduled = self.learner.schedule(0.0)

    def train(self) -> None:
        """Train until ``total_frames``, saving on the way and at the end.

        Raises:
            Stopped: By a signal, after saving.
            NumericalFailure: If a loss or gradient is not finite.
        """
        total, tracker = self.settings.total_frames, self.settings.logger.open(self.run)
        bar = tqdm(total=total, initial=self.frames, unit="frame", disable=None, dynamic_ncols=True)
        start, next_line = time.perf_counter() - self.seconds, 0.0
        try:
            with _Signals() as signals:
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
                        log.info(_line(row, total))
                    if self.frames >= total:
                        break
                    if signals.received or self.frames - self.saved_at >= self.settings.checkpoint.interval:
                        self.save()
                    if signals.received:
                        raise Stopped(signals.received, self.run)
        finally:
            bar.close()
            tracker.close()
        self.mode = self.mode or self._better_mode()
        self.save()

    _last_seconds = 0.0

    def _batches(self, signals: "_Signals") -> Iterator[TensorDictBase]:
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
        row = _episode_columns(batch)
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

    def _update(self, sample: TensorDictBase) -> dict[str, Tensor]:
        """Take one optimiser step and return the loss's terms; nothing is read back from the device but finiteness."""
        learner = self.learner
        terms = learner.loss(sample)
        loss = sum(terms[key] for key in learner.loss_keys)
        loss.backward()
        try:
            torch.nn.utils.clip_grad_norm_(learner.loss.parameters(), learner.max_grad_norm, error_if_nonfinite=True)
        except RuntimeError:
            raise NumericalFailure(
                f"after {self.frames} frames the gradient is not finite, loss {float(loss.detach()):g}; the weights "
                f"were left as they were, and the last checkpoint stands"
            ) from None
        learner.optimizer.step()
        learner.optimizer.zero_grad()
        learner.after_step(sample)
        wanted = {*learner.loss_keys, *learner.columns} & set(terms.keys())
        return {name: terms[name].detach().mean() for name in wanted}

    def _evaluate(self, frames: int) -> float | None:
        interval = self.settings.evaluation.interval
        if not interval or self.frames // interval == (self.frames - frames) // interval:
            return None
        plan = self.settings.evaluation
        env = self.settings.make_env(plan.episodes, plan.first_seed)
        return float(play(env, self.learner.policy, plan.first_seed)["saved"].mean())

    def _better_mode(self) -> str:
        """Return how the policy does better on training seeds, sampled or deterministic."""
        chosen = self.settings.evaluation.mode
        if chosen != "best":
            return chosen
        first = TRAINING_SEEDS * self.settings.seed
        env = self.settings.make_env(min(self.settings.evaluation.episodes, TRAINING_SEEDS), first)
        saved = {mode: play(env, self.learner.policy, first, mode)["saved"].mean() for mode in MODES}
        return max(saved, key=saved.__getitem__)

    def save(self) -> Path:
        """Write a checkpoint of everything."""
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
        )
        self.saved_at = self.frames
        return path

    def state_dict(self) -> dict[str, Any]:
        """Return everything that a run needs to go on exactly as if never stopped."""
        return {
            "loss": dict(self.learner.loss.state_dict()),
            "keeps": {name: each.state_dict() for name, each in self.learner.keeps.items()},
            "optimizer": self.learner.optimizer.state_dict(),
            "random": torch.get_rng_state(),
            "collection": self.collection.state_dict(),
            "reward_scale": {} if self.reward_scale is None else self.reward_scale.state_dict(),
            "frames": self.frames,
            "seconds": self.seconds,
            "rows": self.metrics.rows,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned.

        Raises:
            CheckpointError: If an entry does not fit this configuration.
        """
        try:
            self.learner.loss.load_state_dict(state["loss"])
            self.learner.optimizer.load_state_dict(state["optimizer"])
            for name, each in self.learner.keeps.items():
                each.load_state_dict(state["keeps"][name])
            self.collection.load_state_dict(state["collection"])
            if self.reward_scale is not None:
                self.reward_scale.load_state_dict(state["reward_scale"])
            self.frames, self.seconds = int(state["frames"]), float(state["seconds"])
            self.saved_at, self._last_seconds = self.frames, self.seconds
            self.metrics = MetricsFile(self.run / "metrics.csv", keep_rows=int(state["rows"]))
            self._schedule()
            torch.set_rng_state(state["random"])
        except (KeyError, ValueError, RuntimeError, TypeError) as error:
            reason = " ".join(str(error).split())
            raise checkpoints.CheckpointError(f"the checkpoint does not fit this configuration: {reason}") from None

    def close(self) -> None:
        """Shut the collector down."""
        self.collection.close()


class _Signals:
    """Notes SIGTERM, SIGINT and SIGUSR1; a second one acts as it would have."""

    _WATCHED = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)

    def __init__(self) -> None:
        self.received = 0

    def __enter__(self) -> "_Signals":
        try:
            self._before = {number: signal.signal(number, self._note) for number in self._WATCHED}
        except ValueError:  # not in the main thread, where signals cannot be watched
            self._before = {}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.received:
            raise SystemExit(128 + number)
        self.received = number


def _episode_columns(batch: TensorDictBase) -> dict[str, float | None]:
    """Return the means over the episodes that ended in a batch, None where none did."""
    done = batch["next", "done"][..., 0]
    info = batch["next", "info"]
    count = int(done.sum())
    means = {name: float(info[name][..., 0][done].mean()) if count else None for name in EPISODE_METRICS}
    row = {"rollout/ep_rew_mean": means.pop("episode_reward"), "rollout/ep_len_mean": means.pop("episode_length")}
    return row | {f"world/{name}": value for name, value in means.items()}


def _line(row: Mapping[str, float | None], total: int) -> str:
    def show(name: str, pattern: str) -> str:
        return "-" if row[name] is None else pattern.format(row[name])

    frames = row["time/frames"] or 0
    return (
        f"{100 * frames / total:5.1f} %  {frames} frames  {row['time/seconds']:.0f} s  "
        f"{row['time/fps']:.0f} frames/s  saved {show('world/saved', '{:.3f}')}  "
        f"reward {show('rollout/ep_rew_mean', '{:.2f}')}  loss {show('train/loss', '{:.3f}')}"
    )
