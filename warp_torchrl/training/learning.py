"""Learning from batches: collect, learn, and the state that this leaves, for all algorithms alike.

What differs between algorithms is a field of ``Learner``. Every process of a run learns from its share of the worlds.
"""

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
from warp_torchrl.runs import former
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.transfer import actor_parameters, learned_parameters
from warp_torchrl.training.course import course
from warp_torchrl.training.finite import FiniteSteps, NumericalFailure
from warp_torchrl.training.kickstarting import kickstart
from warp_torchrl.training.progress import TRAIN_COLUMNS, episode_columns
from warp_torchrl.training.recorded import RecordedUpdate
from warp_torchrl.training.share import Played, Share, learners, played
from warp_torchrl.training.weighing import weighing
from warp_torchrl.world.arrays.compile import compile_function


class Learning:
    """What one process of a run does with its share of the worlds.

    Args:
        run_config: What to train; ``n_worlds`` and ``total_frames`` are those of all processes.
    """

    def __init__(self, run_config: RunConfig) -> None:
        torch.manual_seed(run_config.seed)  # the same in every process: all begin with the same networks
        self.run_config = run_config
        worlds = played(run_config)
        self.course = course(run_config, worlds[0].env)
        made = learners(run_config, worlds)
        if run_config.compile:
            made[0].terms = compile_function(made[0].terms)
        made = [self._imitating(learner, each) for learner, each in zip(made, worlds, strict=True)]
        grows = made[0].batches_grow and not run_config.graph  # a recorded update has one size
        self.collector = run_config.collector if grows else replace(run_config.collector, grows_at=0.0)
        self.shares = [
            Share(each, learner, self.collector, run_config) for learner, each in zip(made, worlds, strict=True)
        ]
        """One for each kind of worlds."""
        self.weighing = weighing(run_config, [share.weight for share in self.shares])
        self._steps = FiniteSteps(self.learner.optimizer)
        if run_config.graph:
            self._update = RecordedUpdate(self._update, self.learner.optimizer)  # type: ignore[method-assign, assignment]
        self.frames = 0
        self._schedule()
        self.last_batch = self.frames_per_batch
        """Frames of the last batch."""
        self._others: list[dict[str, Any]] | None = None
        """What a checkpoint holds of the other processes."""
        if parallel.rank():
            torch.manual_seed(_seed_of_process(run_config.seed, parallel.rank()))

    @property
    def env(self) -> WildfireEnv:
        """Return the worlds, of the first kind if there are several."""
        return self.shares[0].env

    @property
    def learner(self) -> Learner:
        """Return what learns, of the first kind of worlds if there are several: the networks are the same."""
        return self.shares[0].learner

    @property
    def collection(self) -> Collection:
        """Return what collects, of the first kind of worlds if there are several."""
        return self.shares[0].collection

    def _imitating(self, learner: Learner, played: Played) -> Learner:
        """Return a learner that learns from a teacher and people too, where it has them."""
        plan, env = self.run_config, played.env
        whom = replace(plan.imitation, teacher=played.kind.teacher)
        taught = kickstart(guided(learner, whom, env), whom, env, played.kind.teacher_weight)
        n_networks = env.n_agents if plan.model.sharing == "none" else 1
        seed = _seed_of_process(plan.seed, parallel.rank())
        return clone(taught, whom, demonstrations(plan, env), n_networks, seed)

    @property
    def frames_per_batch(self) -> int:
        """Return the frames of the current batch, of all processes."""
        return self.run_config.n_worlds * self.collector.segment * self._segments

    def batches(self) -> Iterator[list[TensorDictBase]]:
        """Yield batches [B, T] of so many segments as are due, one of each kind of worlds."""
        collections = [iter(share.collection) for share in self.shares]
        while True:
            yield [self._batch(segments) for segments in collections]

    def _batch(self, segments: Iterator[TensorDictBase]) -> TensorDictBase:
        held = [next(segments).clone() for _ in range(self._segments - 1)]  # the collector writes over them
        return torch.cat([*held, next(segments)], dim=1) if held else next(segments)

    def _learn(self, batches: Sequence[TensorDictBase]) -> dict[str, float | None]:
        """Learn from batches [B, T], one of each kind of worlds, and return their row of ``metrics.csv``."""
        row, unsound = episode_columns(batches, [share.name for share in self.shares])
        if self.course is not None:
            row |= self.course.columns(batches[0])
        if self.weighing is not None:
            row |= self.weighing.columns(row)
        if unsound:
            raise NumericalFailure(f"after {self.frames} frames {unsound[0]} is not finite; the last checkpoint stands")
        for share, batch in zip(self.shares, batches, strict=True):
            if share.reward_scale is not None:
                share.reward_scale(batch)
            share.learner.store(batch)
        sums: dict[str, Tensor] = {}
        updates = 0
        for samples in zip_longest(*(share.learner.samples() for share in self.shares)):
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
        for share in self.shares:
            share.collection.refresh()
        return row

    @property
    def _loss_keys(self) -> tuple[str, ...]:
        """Return the terms of the loss, of all kinds of worlds: some may have no teacher."""
        return tuple(dict.fromkeys(key for share in self.shares for key in share.learner.loss_keys))

    @property
    def _columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the terms, of all kinds of worlds."""
        return {key: column for share in self.shares for key, column in share.learner.columns.items()}

    def _schedule(self) -> None:
        """Update the scheduled hyperparameters; their columns belong to the next row."""
        progress = min(1.0, self.frames / self.run_config.total_frames)
        if self.course is not None:
            self.course.draw(progress)
        if self.weighing is not None:
            for share, weight in zip(self.shares, self.weighing.weights(), strict=True):
                share.weight = weight
        scheduled = [share.learner.schedule(progress) for share in self.shares]
        self._scheduled = scheduled[0]
        self._segments = self.collector.segments(progress)
        """Segments of the next batch."""

    def _update(self, *samples: TensorDictBase | None) -> dict[str, Tensor]:
        """Take one optimiser step and return the loss terms.

        Args:
            samples: One of each kind of worlds; None of those that have no more.
        """
        learner, total = self.learner, torch.zeros((), device=self.env.device)
        found: dict[str, Tensor] = {}
        for share, sample in zip(self.shares, samples, strict=True):
            if sample is None:
                continue
            terms = share.learner.terms(sample)
            loss = share.weight * sum(terms[key] for key in share.learner.loss_keys)
            loss.backward()
            total = total + loss.detach()
            for name in {*share.learner.loss_keys, *share.learner.columns} & set(terms.keys()):
                found[name] = found.get(name, 0.0) + share.weight * terms[name].detach().mean()
        trained = [each.grad for each in learner.loss.parameters() if each.grad is not None]
        parallel.mean_([*trained, total])
        norm = torch.nn.utils.clip_grad_norm_(learner.loss.parameters(), learner.max_grad_norm)
        self._steps.take(total, norm, self.frames)
        learner.optimizer.zero_grad()
        for share, sample in zip(self.shares, samples, strict=True):
            if sample is not None:
                share.learner.after_step(sample)
        return found

    def start_from(self, found: Checkpoint) -> None:
        """Load another run's networks and value normalisation; everything else starts anew.

        Of an exported policy there are the actor's networks alone; the critic's start anew too.

        Raises:
            CheckpointError: If that run had another kind of loss or other networks.
        """
        if not found.goes_on:
            self.learner.policy.load_state_dict(actor_parameters(found, self.learner))
            return
        loss = self.learner.loss
        loss.load_state_dict({**loss.state_dict(), **learned_parameters(found, loss)})

    def state_dict(self) -> dict[str, Any]:
        """Return everything that an exact resume needs of this process."""
        return {
            "loss": dict(self.learner.loss.state_dict()),
            "optimizer": self.learner.optimizer.state_dict(),
            **self._own(),
            **({} if self.course is None else {"curriculum": self.course.state_dict()}),
            **({} if self.weighing is None else {"weighing": self.weighing.state_dict()}),
            "frames": self.frames,
        }

    def _own(self) -> dict[str, Any]:
        """Return what differs from process to process."""
        return {
            **self.shares[0].state_dict(),
            **({"shares": [share.state_dict() for share in self.shares[1:]]} if len(self.shares) > 1 else {}),
            "random": torch.get_rng_state(),
            "random_cuda": torch.cuda.get_rng_state(self.env.device) if self.env.device.type == "cuda" else None,
        }

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
        self.frames = int(state["frames"])
        if self.course is not None:
            self.course.load_state_dict(state["curriculum"])
        if self.weighing is not None:
            self.weighing.load_state_dict(state["weighing"])
        self._schedule()

    def _restore_own(self, state: Mapping[str, Any]) -> None:
        for share, its in zip(self.shares, [state, *state.get("shares", ())], strict=True):
            share.load_state_dict(its)
        torch.set_rng_state(state["random"])
        if state.get("random_cuda") is not None:
            torch.cuda.set_rng_state(state["random_cuda"], self.env.device)

    def join(self) -> None:
        """Give the other processes what the first one begins with, or has resumed."""
        if parallel.size() == 1:
            return
        begun = parallel.share({**self.state_dict(), "others": self._others} if not parallel.rank() else None)
        if not parallel.rank():
            return
        self._restore_shared(begun)
        if begun["others"] is not None:
            self._restore_own(begun["others"][parallel.rank() - 1])
        elif self.frames:  # saved when this process had ended
            for share in self.shares:
                share.collection.start_anew(self.frames // self.run_config.n_worlds)

    def close(self) -> None:
        """Shut the collectors down."""
        for share in self.shares:
            share.collection.close()


def _seed_of_process(seed: int, rank: int) -> int:
    """Return the seed of a process's draws, of actions and of minibatches."""
    return (seed + 2**40 * rank) % 2**64
