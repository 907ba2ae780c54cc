"""Learning from batches: collect, learn, and the state that this leaves, for all algorithms alike.

What differs between algorithms is a field of ``Learner``. Every process of a run learns from its share of the worlds.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl import parallel
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.cloning import clone
from warp_torchrl.collection.guidance import guided
from warp_torchrl.collection.kickstarting import kickstart
from warp_torchrl.config.run_config import RunConfig
from warp_torchrl.config.seeds import first_world_seed
from warp_torchrl.demonstrations.acts import demonstrations
from warp_torchrl.runs import former
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.transfer import actor_parameters, learned_parameters
from warp_torchrl.training.course import course
from warp_torchrl.training.finite import FiniteSteps, NumericalFailure
from warp_torchrl.training.progress import TRAIN_COLUMNS, episode_columns
from warp_torchrl.training.recorded import RecordedUpdate
from warp_torchrl.training.reward_scale import RewardScale
from warp_torchrl.world.fast.compile import compile_function


class Learning:
    """What one process of a run does with its share of the worlds.

    Args:
        run_config: What to train; ``n_worlds`` and ``total_frames`` are those of all processes.
    """

    def __init__(self, run_config: RunConfig) -> None:
        torch.manual_seed(run_config.seed)  # the same in every process: all begin with the same networks
        self.run_config = run_config
        worlds = run_config.n_worlds // parallel.size()
        first = first_world_seed(run_config.seed) + worlds * parallel.rank()
        self.env = run_config.make_training_env(worlds, first)
        self.course = course(run_config, self.env)
        learner = run_config.algorithm.build(self.env, run_config.model, run_config.collector.steps * worlds)
        if run_config.compile:
            learner.terms = compile_function(learner.terms)
        self.learner = self._imitating(learner)
        self._steps = FiniteSteps(self.learner.optimizer)
        if run_config.graph:
            self._update = RecordedUpdate(self._update, self.learner.optimizer)  # type: ignore[method-assign]
        self.reward_scale = RewardScale(run_config.reward.gamma) if run_config.reward.normalise else None
        grows = self.learner.batches_grow and not run_config.graph  # a recorded update has one size
        self.collector = run_config.collector if grows else replace(run_config.collector, grows_at=0.0)
        self.collection = self.collector.open(self.env, self.learner, run_config.make_training_env, first)
        self.frames = 0
        self._schedule()
        self.last_batch = self.frames_per_batch
        """Frames of the last batch."""
        self._others: list[dict[str, Any]] | None = None
        """What a checkpoint holds of the other processes."""
        if parallel.rank():
            torch.manual_seed(_seed_of_process(run_config.seed, parallel.rank()))

    def _imitating(self, learner: Learner) -> Learner:
        """Return a learner that learns from the run's teacher and people too, where it has them."""
        plan = self.run_config
        taught = kickstart(guided(learner, plan.imitation, self.env), plan.imitation, self.env)
        n_networks = self.env.n_agents if plan.model.sharing == "none" else 1
        seed = _seed_of_process(plan.seed, parallel.rank())
        return clone(taught, plan.imitation, demonstrations(plan, self.env), n_networks, seed)

    @property
    def frames_per_batch(self) -> int:
        """Return the frames of the current batch, of all processes."""
        return self.run_config.n_worlds * self.collector.segment * self._segments

    def batches(self) -> Iterator[TensorDictBase]:
        """Yield batches [B, T] of so many segments as are due."""
        held: list[TensorDictBase] = []
        for segment in self.collection:
            if len(held) + 1 < self._segments:
                held.append(segment.clone())  # the collector writes over it
                continue
            yield torch.cat([*held, segment], dim=1) if held else segment
            held = []

    def _learn(self, batch: TensorDictBase) -> dict[str, float | None]:
        """Learn from one batch [B, T] and return its row of ``metrics.csv``."""
        learner = self.learner
        row, unsound = episode_columns(batch)
        if self.course is not None:
            row |= self.course.columns(batch)
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
        self.last_batch = self.frames_per_batch
        self.frames += self.last_batch
        row["train/loss"] = sum(means[key] for key in learner.loss_keys) if updates else None
        row |= dict.fromkeys(TRAIN_COLUMNS)
        row |= {column: means.get(key) for key, column in learner.columns.items()} | self._scheduled
        entropy = row["train/entropy"]
        row["train/entropy_loss"] = None if entropy is None else -entropy  # whatever its weight, as others have it
        self._schedule()
        self.collection.refresh()
        return row

    def _schedule(self) -> None:
        """Update the scheduled hyperparameters; their columns belong to the next row."""
        progress = min(1.0, self.frames / self.run_config.total_frames)
        if self.course is not None:
            self.course.draw(progress)
        self._scheduled = self.learner.schedule(progress)
        self._segments = self.collector.segments(progress)
        """Segments of the next batch."""

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
            "frames": self.frames,
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
            self.collection.start_anew(self.frames // self.run_config.n_worlds)

    def close(self) -> None:
        """Shut the collector down."""
        self.collection.close()


def _seed_of_process(seed: int, rank: int) -> int:
    """Return the seed of a process's draws, of actions and of minibatches."""
    return (seed + 2**40 * rank) % 2**64
