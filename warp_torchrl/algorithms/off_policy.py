"""Base of the off-policy algorithms: replay memory, target networks, and schedule of updates."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from tensordict.utils import expand_right
from torchrl.data import Categorical, ReplayBuffer
from torchrl.data.postprocs import MultiStep
from torchrl.envs import EnvBase
from torchrl.modules import EGreedyModule
from torchrl.objectives import HardUpdate, LossModule, SoftUpdate
from torchrl.objectives.utils import TargetNetUpdater

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.algorithm import Algorithm, falling
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.replay import ReplayMemory, check_prioritised, replay_buffer, weighted
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    CANONICAL_STATE,
    REWARD,
    CanonicalBatch,
    Mlp,
    Signature,
    signature,
)

AGENT_KEYS = {"reward": REWARD, "done": ("agents", "done"), "terminated": ("agents", "terminated")}
"""Keys of TorchRL's losses for values of each agent; the team's end is each agent's end."""
STEPS_TO_NEXT = "steps_to_next_obs"
"""Key of the number of steps whose rewards a transition sums, where it is not 1."""
TEAM_REWARD = "team_reward"
"""Key of the team's mean reward, for a value of the whole team."""


@dataclass(frozen=True, kw_only=True)
class OffPolicy(Algorithm):
    """Base class of DQN, SAC and DDPG.

    Attributes:
        capacity: World steps that the replay memory holds; the oldest fall out.
        warm_up: World steps in the memory before learning starts.
        minibatch_size: World steps in a minibatch (each has one sample an agent).
        updates: Optimiser steps after each batch of the collector.
        replay: ``uniform``, or ``prioritised`` by the temporal-difference error (Schaul et al., 2016).
        target_interval: Optimiser steps between copies into the target networks; 0 lets them follow at ``tau``.
        tau: How far the target networks move towards the others in an optimiser step.
        n_step: World steps whose rewards a target sums before it takes the value of what they led to (Sutton 1988);
            fewer where an episode or a batch of the collector ends.

    Raises:
        ValueError: If a value is out of its range, ``n_step`` is above 1 where ``gamma`` is 0, or prioritised replay
            does not work here.
    """

    learning_rate: float = 5e-4
    learning_rate_end: float = 0.1
    max_grad_norm: float = 10.0
    capacity: int = 50_000
    warm_up: int = 8192
    minibatch_size: int = 256
    updates: int = 64
    replay: Literal["uniform", "prioritised"] = "uniform"
    target_interval: int = 0
    tau: float = 0.01
    n_step: int = 1

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        large = (1, 10**9)
        own = {"capacity": large, "minibatch_size": large, "updates": large, "warm_up": (0, 10**9), "n_step": (1, 1024)}
        super().check(**own, target_interval=(0, 10**9), tau=(1e-6, 1.0), **ranges)
        if self.warm_up > self.capacity:
            raise ValueError(f"warm_up must be at most capacity, {self.capacity}, got {self.warm_up}")
        if self.n_step > 1 and self.gamma == 0.0:
            raise ValueError(f"n_step must be 1 where gamma is 0, got {self.n_step}")
        if self.replay == "prioritised":
            check_prioritised()

    def check_batch(self, frames_per_batch: int) -> None:
        """Check that a batch fits into the memory.

        Raises:
            ValueError: If not.
        """
        if frames_per_batch > self.capacity:
            raise ValueError(
                f"capacity must be at least a batch, n_worlds x collector.steps = {frames_per_batch}, "
                f"got {self.capacity}"
            )

    def check_model(self, model: Mlp) -> None:
        """Check that the actors are not recurrent, since transitions are replayed one by one, and do not talk.

        Raises:
            ValueError: If they are, or do.
        """
        if model.talks:
            raise ValueError(
                f"messages must be none or map where the algorithm replays, got {model.messages}: choose mappo, ippo, "
                "ppo or a2c"
            )
        if model.memory:
            raise ValueError(
                f"memory must be 0 where the algorithm replays, got {model.memory}: choose mappo, ippo, ppo or a2c"
            )

    def build(self, env: EnvBase, model: Mlp, frames_per_batch: int) -> Learner:
        """Return a learner for an environment.

        Args:
            env: Whose specs it fits, and on whose device it lives.
            model: Makes the networks.
            frames_per_batch: World steps that are collected between updates.

        Raises:
            ValueError: If a batch does not fit into the memory.
        """
        self.check_batch(frames_per_batch * parallel.size())
        shape = signature(env)
        policy = self.policy(shape, model).to(env.device)
        loss = self.loss(policy, shape, model, env.device).to(env.device)
        optimizer = torch.optim.Adam(loss.parameters(), lr=self.learning_rate, eps=1e-5, fused=True)
        memory = self.memory(env.device)
        targets = self.targets(loss)
        explore = self.explorer(policy, shape).to(env.device)
        canonical = model.canonical_batch(shape, state=CANONICAL_STATE in loss.in_keys, restored=True)

        def samples() -> Iterator[TensorDictBase]:
            enough = len(memory) >= max(self.warm_up, self.minibatch_size) // parallel.size()
            return (weighted(memory.sample()) for _ in range(self.updates if enough else 0))

        def after_step(sample: TensorDictBase) -> None:
            targets.step()
            if self.replay == "prioritised":
                memory.update_tensordict_priority(sample.set("td_error", sample["td_error"].flatten(1).amax(dim=1)))

        def schedule(progress: float) -> dict[str, float]:
            return {"train/learning_rate": self.rate_at(progress, optimizer), **self.explore_at(progress, explore)}

        return Learner(
            policy=policy,
            explore=explore,
            loss=loss,
            terms=loss,
            loss_keys=self.loss_keys(),
            columns=self.columns(),
            optimizer=optimizer,
            max_grad_norm=self.max_grad_norm,
            store=lambda batch: memory.extend(transitions(loss, batch, canonical, self.n_step, self.gamma)),
            samples=samples,
            after_step=after_step,
            schedule=schedule,
            keeps={"replay": ReplayMemory(memory), "targets": targets},
        )

    def memory(self, device: torch.device) -> ReplayBuffer:
        """Return TorchRL's replay buffer; several processes share its capacity and its minibatches equally."""
        share = parallel.size()
        return replay_buffer(self.replay, self.capacity // share, max(1, self.minibatch_size // share), device)

    def targets(self, loss: LossModule) -> TargetNetUpdater:
        """Return TorchRL's updater of the target networks."""
        if self.target_interval:
            # TorchRL counts the steps between two copies, not the steps from one to the next.
            return HardUpdate(loss, value_network_update_interval=self.target_interval - 1)
        return SoftUpdate(loss, tau=self.tau)

    def policy(self, shape: Signature, model: Mlp) -> TensorDictModuleBase:
        """Return the team's decentralised policy: each agent's action depends on its observation and mask."""
        raise TypeError(f"{type(self).__name__} does not say how it acts: define policy()")

    def explorer(self, policy: TensorDictModuleBase, shape: Signature) -> TensorDictModuleBase:
        """Return the collector's policy; by default the policy itself, which explores by sampling."""
        return policy

    def explore_at(self, progress: float, explore: TensorDictModuleBase) -> dict[str, float]:
        """Set the exploration at progress in 0..1, and return it as columns."""
        return {}

    def loss(self, policy: TensorDictModuleBase, shape: Signature, model: Mlp, device: torch.device) -> LossModule:
        """Return TorchRL's loss with its value estimator."""
        raise TypeError(f"{type(self).__name__} does not say what it minimises: define loss()")

    def loss_keys(self) -> tuple[str, ...]:
        """Return the entries of the loss's output that are summed and minimised."""
        return ("loss",)

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {"loss": "train/value_loss"}


@dataclass(frozen=True, kw_only=True)
class EpsilonGreedy(OffPolicy):
    """Epsilon-greedy exploration of DQN and DDPG, among the actions that the mask allows.

    Attributes:
        epsilon: Share of random actions at the start.
        epsilon_end: At the end.
        epsilon_until: Progress in 0..1 at which the end is reached; it falls linearly.

    Raises:
        ValueError: If a value is out of its range, or prioritised replay does not work here.
    """

    epsilon: float = 1.0
    epsilon_end: float = 0.05
    epsilon_until: float = 0.3

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        own = {"epsilon": (0.0, 1.0), "epsilon_end": (0.0, self.epsilon), "epsilon_until": (1e-6, 1.0)}
        super().check(**own, **ranges)

    def epsilon_greedy(self, shape: Signature, epsilon: float) -> EGreedyModule:
        """Return TorchRL's module that replaces an action now and then, unless exploration is off."""
        return EGreedyModule(
            Categorical(shape.n_actions),
            eps_init=epsilon,
            eps_end=self.epsilon_end,
            action_key=ACTION,
            action_mask_key=ACTION_MASK,
        )

    def explore_at(self, progress: float, explore: TensorDictModuleBase) -> dict[str, float]:
        """Set epsilon."""
        epsilon = falling(self.epsilon, self.epsilon_end, progress / self.epsilon_until)
        for module in explore.modules():
            if isinstance(module, EGreedyModule):
                module.eps.fill_(epsilon)
        return {"rollout/exploration_rate": epsilon}


def transitions(
    loss: LossModule, batch: TensorDictBase, canonical: CanonicalBatch, n_step: int, gamma: float
) -> TensorDictBase:
    """Return a loss's inputs from a batch, with the team's end for each agent; [B, T] -> [B T].

    With ``n_step`` above 1 what follows a step is what its next n steps led to: their discounted rewards, the
    observation and the ends after them, and their number under ``steps_to_next_obs``, by which the losses' estimators
    discount.
    """
    batch = canonical(batch).set("next", canonical(batch["next"]))
    reward = batch["next", *REWARD]
    batch["next", TEAM_REWARD] = reward.mean(dim=-2)
    for name in ("done", "terminated"):
        batch["next", "agents", name] = batch["next", name].unsqueeze(-2).expand(reward.shape)
    if n_step > 1:
        batch = _several_steps(batch.select(*loss.in_keys, ("next", "done"), strict=False), loss, n_step, gamma)
    return batch.select(*loss.in_keys, STEPS_TO_NEXT, strict=False).reshape(-1)


def _several_steps(batch: TensorDictBase, loss: LossModule, n_step: int, gamma: float) -> TensorDictBase:
    """Return a batch [B, T] whose next entries are those of n steps later, or of the episode's or the batch's end."""
    key = loss.tensor_keys.reward
    several = MultiStep(gamma, n_step)
    several.reward_keys, several.done_keys = (key,), ()  # the ends too are those of n steps later
    batch = several(batch)
    steps = batch[STEPS_TO_NEXT].to(torch.float32)  # [B, T]; the estimators read it in the reward's shape
    batch[STEPS_TO_NEXT] = expand_right(steps, batch["next"].get(key).shape).contiguous()
    return batch
