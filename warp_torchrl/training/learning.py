"""Learning from batches: collection, learning and its state, for all algorithms alike.

What differs between algorithms is a field of ``Learner``. Every process of a run learns from its share of the worlds.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.cloning import clone
from warp_torchrl.collection.guidance import guided
from warp_torchrl.collection.running import Collection
from warp_torchrl.demonstrations.acts import demonstrations
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import signature
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.transfer import start_of
from warp_torchrl.system.compiler import compile_function
from warp_torchrl.training.finite import FiniteSteps, NumericalFailure
from warp_torchrl.training.kickstarting import kickstart
from warp_torchrl.training.level_sampler import level_sampler
from warp_torchrl.training.progress import TRAIN_COLUMNS, batch_columns
from warp_torchrl.training.recorded import RecordedUpdate
from warp_torchrl.training.tasks import Task, TaskWorlds, learners, task_worlds
from warp_torchrl.training.weighing import weighing

log = logging.getLogger("warp_torchrl")


class Learning:
    """Collection and learning of one process of a run, on its share of the worlds.

    Args:
        run_config: What to train; ``n_worlds`` and ``total_frames`` are those of all processes.
    """

    def __init__(self, run_config: RunConfig) -> None:
        torch.manual_seed(run_config.seed)  # the same in every process: all begin with the same networks
        self.run_config = run_config
        worlds = task_worlds(run_config)
        self.level_sampler = level_sampler(run_config, worlds[0].env)
        made = learners(run_config, worlds)
        if run_config.compile:
            made[0].terms = compile_function(made[0].terms)
        made = [self._imitating(learner, each) for learner, each in zip(made, worlds, strict=True)]
        grows = made[0].batches_grow and not run_config.graph  # a recorded update has one size
        self.collector = run_config.collector if grows else replace(run_config.collector, grows_at=0.0)
        self.tasks = [
            Task(each, learner, self.collector, run_config) for learner, each in zip(made, worlds, strict=True)
        ]
        """One for each kind of worlds."""
        self.weighing = weighing(run_config, [task.weight for task in self.tasks])
        self._steps = FiniteSteps(self.learner.optimizer)
        if run_config.graph:
            self._update = RecordedUpdate(self._update, self.learner.optimizer)  # type: ignore[method-assign, assignment]
        self.frames = 0
        self._schedule()
        self.last_batch = self.frames_per_batch
        """Frames of the last batch."""
        self._others: list[dict[str, Any]] | None = None
        """State of the other processes in a checkpoint."""
        if parallel.rank():
            torch.manual_seed(_seed_of_process(run_config.seed, parallel.rank()))

    @property
    def env(self) -> WildfireEnv:
        """Return the worlds, of the first kind if there are several."""
        return self.tasks[0].env

    @property
    def learner(self) -> Learner:
        """Return the learner, of the first kind of worlds if there are several: the networks are the same."""
        return self.tasks[0].learner

    @property
    def collection(self) -> Collection:
        """Return the collection, of the first kind of worlds if there are several."""
        return self.tasks[0].collection

    def _imitating(self, learner: Learner, worlds: TaskWorlds) -> Learner:
        """Return a learner that learns from a teacher and people too, where it has them."""
        run_config, env = self.run_config, worlds.env
        imitation = replace(run_config.imitation, teacher=worlds.kind.teacher)
        taught = kickstart(guided(learner, imitation, env), imitation, env, worlds.kind.teacher_weight)
        n_networks = env.n_agents if run_config.model.sharing == "none" else 1
        seed = _seed_of_process(run_config.seed, parallel.rank())
        return clone(taught, imitation, demonstrations(run_config, env), n_networks, seed)

    @property
    def frames_per_batch(self) -> int:
        """Return the frames of the current batch, of all processes."""
        return self.run_config.n_worlds * self.collector.segment * self._segments

    def batches(self) -> Iterator[list[TensorDictBase]]:
        """Yield batches [B, T] of as many segments as are due, one of each kind of worlds."""
        collections = [iter(task.collection) for task in self.tasks]
        while True:
            yield [self._batch(segments) for segments in collections]

    def _batch(self, segments: Iterator[TensorDictBase]) -> TensorDictBase:
        held = [next(segments).clone() for _ in range(self._segments - 1)]  # the collector writes over them
        return torch.cat([*held, next(segments)], dim=1) if held else next(segments)

    def _learn(self, batches: Sequence[TensorDictBase]) -> dict[str, float | None]:
        """Learn from batches [B, T], one of each kind of worlds, and return their row of ``metrics.csv``."""
        teams, kinds = zip(*((task.env.world.team, task.name) for task in self.tasks), strict=True)
        row, unsound = batch_columns(batches, teams, kinds)
        if self.level_sampler is not None:
            row |= self.level_sampler.columns(batches[0])
        if self.weighing is not None:
            row |= self.weighing.columns(row)
        if unsound:
            raise NumericalFailure(f"after {self.frames} frames {unsound[0]} is not finite; the last checkpoint stands")
        for task, batch in zip(self.tasks, batches, strict=True):
            if task.reward_scale is not None:
                task.reward_scale(batch)
            task.learner.store(batch)
        sums: dict[str, Tensor] = {}
        updates = 0
        for samples in zip_longest(*(task.learner.samples() for task in self.tasks)):
            for name, value in self._update(*samples).items():
                sums[name] = sums.get(name, 0.0) + value
            updates += 1
        if updates:
            parallel.mean_(sums[name] for name in sorted(sums))
        means = {name: value / updates for name, value in self._steps.read(sums, self.frames).items()}
        self.last_batch = self.frames_per_batch
        self.frames += self.last_batch
        row["train/loss"] = sum(means[key] for key in self._loss_keys) if updates else None
        row |= dict.fromkeys(TRAIN_COLUMNS)
        row |= {column: means.get(key) for key, column in self._columns.items()} | self._scheduled
        entropy = row["train/entropy"]
        row["train/entropy_loss"] = None if entropy is None else -entropy  # whatever its weight, as others have it
        self._schedule()
        for task in self.tasks:
            task.collection.refresh()
        return row

    @property
    def _loss_keys(self) -> tuple[str, ...]:
        """Return the terms of the loss, of all kinds of worlds: some may have no teacher."""
        return tuple(dict.fromkeys(key for task in self.tasks for key in task.learner.loss_keys))

    @property
    def _columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the terms, of all kinds of worlds."""
        return {key: column for task in self.tasks for key, column in task.learner.columns.items()}

    def _schedule(self) -> None:
        """Update the scheduled hyperparameters; their columns belong to the next row."""
        progress = min(1.0, self.frames / self.run_config.total_frames)
        if self.level_sampler is not None:
            self.level_sampler.draw(progress)
        if self.weighing is not None:
            for task, weight in zip(self.tasks, self.weighing.weights(), strict=True):
                task.weight = weight
        scheduled = [task.learner.schedule(progress) for task in self.tasks]
        self._scheduled = scheduled[0]
        self._segments = self.collector.segments(progress)
        """Segments of the next batch."""

    def _update(self, *samples: TensorDictBase | None) -> dict[str, Tensor]:
        """Take one optimiser step and return the loss terms.

        Args:
            samples: One of each kind of worlds; None of a kind without further samples.
        """
        learner, total = self.learner, torch.zeros((), device=self.env.device)
        found: dict[str, Tensor] = {}
        for task, sample in zip(self.tasks, samples, strict=True):
            if sample is None:
                continue
            terms = task.learner.terms(sample)
            loss = task.weight * sum(terms[key] for key in task.learner.loss_keys)
            loss.backward()
            total = total + loss.detach()
            for name in {*task.learner.loss_keys, *task.learner.columns} & set(terms.keys()):
                found[name] = found.get(name, 0.0) + task.weight * terms[name].detach().mean()
        trained = [each.grad for each in learner.loss.parameters() if each.grad is not None]
        parallel.mean_([*trained, total])
        norm = torch.nn.utils.clip_grad_norm_(learner.loss.parameters(), learner.max_grad_norm)
        self._steps.take(total, norm, self.frames)
        learner.optimizer.zero_grad()
        for task, sample in zip(self.tasks, samples, strict=True):
            if sample is not None:
                task.learner.after_step(sample)
        return found

    def start_from(self, found: Checkpoint) -> None:
        """Load another run's networks and value normalisation; everything else starts fresh.

        An exported policy has the actor's networks only; then the critic's start fresh too, as they do where agents or
        critic see something else.

        Raises:
            CheckpointError: If that run had another kind of loss or other networks.
        """
        start = start_of(found, self.run_config, self.learner, signature(self.env))
        start.part.load_state_dict(start.parameters)
        for note in start.notes:
            log.info(note)

    def state_dict(self) -> dict[str, Any]:
        """Return everything that an exact resume needs of this process."""
        return {
            "loss": dict(self.learner.loss.state_dict()),
            "optimizer": self.learner.optimizer.state_dict(),
            **self._own(),
            **({} if self.level_sampler is None else {"curriculum": self.level_sampler.state_dict()}),
            **({} if self.weighing is None else {"weighing": self.weighing.state_dict()}),
            "frames": self.frames,
        }

    def _own(self) -> dict[str, Any]:
        """Return the part of the state that differs from process to process."""
        return {
            **self.tasks[0].state_dict(),
            **({"shares": [task.state_dict() for task in self.tasks[1:]]} if len(self.tasks) > 1 else {}),
            "random": torch.get_rng_state(),
            "random_cuda": torch.cuda.get_rng_state(self.env.device) if self.env.device.type == "cuda" else None,
        }

    def _restore(self, state: Mapping[str, Any]) -> None:
        self._restore_shared(state)
        self._restore_own(state)

    def _restore_shared(self, state: Mapping[str, Any]) -> None:
        loss = state["loss"]
        differing = self.learner.loss.state_dict().keys() ^ loss.keys()
        if differing:  # tensordict does not report missing or unexpected names
            raise ValueError(f"{min(differing)} is in one of the two alone")
        self.learner.loss.load_state_dict(loss)
        self.learner.optimizer.load_state_dict(state["optimizer"])
        self.frames = int(state["frames"])
        if self.level_sampler is not None:
            self.level_sampler.load_state_dict(state["curriculum"])
        if self.weighing is not None:
            self.weighing.load_state_dict(state["weighing"])
        self._schedule()

    def _restore_own(self, state: Mapping[str, Any]) -> None:
        for task, its in zip(self.tasks, [state, *state.get("shares", ())], strict=True):
            task.load_state_dict(its)
        torch.set_rng_state(state["random"])
        if state.get("random_cuda") is not None:
            torch.cuda.set_rng_state(state["random_cuda"], self.env.device)

    def join(self) -> None:
        """Send the first process's initial or resumed state to the others."""
        if parallel.size() == 1:
            return
        begun = parallel.share({**self.state_dict(), "others": self._others} if not parallel.rank() else None)
        if not parallel.rank():
            return
        self._restore_shared(begun)
        if begun["others"] is not None:
            self._restore_own(begun["others"][parallel.rank() - 1])
        elif self.frames:  # saved when this process had ended
            for task in self.tasks:
                task.collection.start_anew(self.frames // self.run_config.n_worlds)

    def close(self) -> None:
        """Shut the collectors down."""
        for task in self.tasks:
            task.collection.close()


def _seed_of_process(seed: int, rank: int) -> int:
    """Return the seed of a process's draws, of actions and of minibatches."""
    return (seed + 2**40 * rank) % 2**64
