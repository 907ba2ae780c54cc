"""Base of the on-policy algorithms: actors, critics, advantages and schedules."""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torchrl.envs import EnvBase
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import LossModule

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.algorithm import Algorithm, falling, masked_actor
from warp_torchrl.algorithms.held_batch import ADVANTAGE, VALUE_TARGET, HeldBatch
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.models import (
    ACTION,
    LOG_PROB,
    REWARD,
    VALUE,
    Mlp,
    Recollection,
    RemembersApart,
    Signature,
    arithmetic_of,
    over_canonical,
    signature,
)

LOSS_ENTRIES = {
    "action": ACTION,
    "sample_log_prob": LOG_PROB,
    "value": VALUE,
    "reward": REWARD,
    "done": "done",
    "terminated": "terminated",
    "advantage": ADVANTAGE,
    "value_target": VALUE_TARGET,
}
"""Where TorchRL's losses find their entries."""


@dataclass(frozen=True, kw_only=True)
class OnPolicy(Algorithm):
    """Base class of PPO and A2C.

    Attributes:
        central_critic: Whether values depend on the state and each agent's observation, or on the latter only.
        lmbda: GAE's lambda.
        entropy_coeff: Weight of the entropy bonus at the start.
        entropy_coeff_end: At the end; it falls linearly.
        critic_coeff: Weight of the value loss.
        critic_first: Share of the training in which only the critic learns, and the actor is frozen: for a team that
            starts from an exported policy, whose critic is new.
        minibatch_size: World steps in a minibatch of the largest batch (each has one sample an agent), and in
            proportion of a smaller one; where actors remember, in as many whole sequences as fit, one at least.

    Raises:
        ValueError: If a value is out of its range.
    """

    central_critic: bool = True
    lmbda: float = 0.95
    entropy_coeff: float = 0.005
    entropy_coeff_end: float = 0.0005
    critic_coeff: float = 1.0
    critic_first: float = 0.0
    minibatch_size: int = 1024

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        shares = dict.fromkeys(("lmbda", "entropy_coeff", "entropy_coeff_end", "critic_first"), (0.0, 1.0))
        super().check(minibatch_size=(1, 1_000_000), critic_coeff=(0.0, 100.0), **shares, **ranges)

    def policy(self, shape: Signature, model: Mlp) -> ProbabilisticActor:
        """Return the team's decentralised policy: each agent's action depends on its observation and mask."""
        return masked_actor(shape, model)

    def build(
        self, env: EnvBase, model: Mlp, frames_per_batch: int, shape: Signature | None = None, share: float = 1.0
    ) -> Learner:
        """Return a learner for an environment.

        Args:
            env: Whose specs it fits, and on whose device it lives.
            model: Makes the networks.
            frames_per_batch: World steps that are collected between updates.
            shape: What the networks fit; None reads it off the environment.
            share: Of a minibatch that this environment fills.
        """
        shape = signature(env) if shape is None else shape
        policy = self.policy(shape, model).to(env.device)
        critic = model.critic(shape, self.central_critic).to(env.device)
        loss = self.loss(over_canonical(policy), over_canonical(critic)).to(env.device)
        loss.value_estimator.value_network = None  # it reads the values that ``with_advantages`` adds
        optimizer = torch.optim.Adam(loss.parameters(), lr=self.learning_rate, eps=1e-5, fused=True)

        def schedule(progress: float) -> dict[str, float]:
            loss.entropy_coeff.fill_(falling(self.entropy_coeff, self.entropy_coeff_end, progress))
            policy.requires_grad_(progress >= self.critic_first)
            return {"train/learning_rate": self.rate_at(progress, optimizer), **self.constants()}

        batch = self._held(loss, env, model, frames_per_batch, shape, share)
        return Learner(
            policy=policy,
            explore=policy,
            loss=loss,
            terms=loss,
            loss_keys=("loss_objective", "loss_critic", "loss_entropy"),
            columns=self.columns(),
            optimizer=optimizer,
            max_grad_norm=self.max_grad_norm,
            store=batch.store,
            samples=batch.samples,
            after_step=lambda sample: None,
            schedule=schedule,
            keeps={"memory": Recollection(policy)} if model.memory else {},
            batches_grow=not model.memory,
        )

    def beside(
        self, learner: Learner, env: EnvBase, model: Mlp, frames_per_batch: int, shape: Signature, share: float
    ) -> Learner:
        """Return a learner of the same networks, with the same optimiser, from batches of another environment.

        Args:
            learner: What ``build`` returned.
            env: Whose worlds it learns from.
            model: Made the networks.
            frames_per_batch: World steps of this environment that are collected between updates.
            shape: What the networks fit.
            share: Of a minibatch that this environment fills.
        """
        batch = self._held(learner.loss, env, model, frames_per_batch, shape, share)
        made = replace(learner, explore=learner.policy, store=batch.store, samples=batch.samples, keeps={})
        if not model.memory:
            return made
        explore = RemembersApart(learner.policy)
        return replace(made, explore=explore, keeps={"memory": Recollection(explore)})

    def _held(
        self, loss: LossModule, env: EnvBase, model: Mlp, frames: int, shape: Signature, share: float
    ) -> HeldBatch:
        """Return the buffer of an environment's batches."""
        remembers = bool(model.memory)
        return HeldBatch(
            loss,
            model.canonical_batch(shape, state=self.central_critic, packed=True),
            arithmetic_of(loss.critic_network, env.device.type),
            frames=frames,
            steps=frames // env.batch_size[0] if remembers else None,
            minibatch_size=max(1, round(self.minibatch_size * share / parallel.size())),
            passes=self.passes(),
            standardises=self.standardises() if parallel.size() > 1 else None,
            device=env.device,
        )

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> LossModule:
        """Return TorchRL's loss with its value estimator."""
        raise TypeError(f"{type(self).__name__} does not say what it minimises: define loss()")

    def standardises(self) -> Literal["minibatch", "batch"] | None:
        """Return the set over which advantages are standardised, of all processes; None leaves it to the loss."""
        return None

    def passes(self) -> int:
        """Return the number of passes over each batch."""
        return 1

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {
            "loss_objective": "train/policy_gradient_loss",
            "loss_critic": "train/value_loss",
            "entropy": "train/entropy",
            "explained_variance": "train/explained_variance",
        }

    def constants(self) -> dict[str, float]:
        """Return the columns that are constant."""
        return {}
