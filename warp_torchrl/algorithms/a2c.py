"""Advantage actor-critic for teams, from TorchRL's loss.

Mnih et al., "Asynchronous Methods for Deep Reinforcement Learning", 2016; its synchronous form.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import A2CLoss, ValueEstimators

from warp_torchrl import parallel
from warp_torchrl.algorithms.on_policy import KEYS, OnPolicy


@dataclass(frozen=True, kw_only=True)
class A2c(OnPolicy):
    """A2C with multi-agent generalised advantage estimation: each batch is seen once.

    Its minibatches are as many optimiser steps: small ones or short batches of the collector are best.

    Attributes:
        normalize_advantage: Whether each agent's advantages of a batch are standardised, as PPO's are.

    Raises:
        ValueError: If a value is out of its range.
    """

    entropy_coeff: float = 0.02
    entropy_coeff_end: float = 0.002
    critic_coeff: float = 0.5
    minibatch_size: int = 512
    normalize_advantage: bool = True

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> A2CLoss:
        """Return TorchRL's loss, with the estimator that gives a team's end to each agent."""
        loss = A2CLoss(
            policy,
            critic,
            entropy_coeff=self.entropy_coeff or 1.0,  # at 0 TorchRL would leave the term out for good
            critic_coeff=self.critic_coeff,
            loss_critic_type="l2",
        )
        loss.entropy_coeff.fill_(self.entropy_coeff)
        loss.set_keys(**KEYS)
        alone = parallel.size() == 1  # else ``standardises`` has it
        loss.make_value_estimator(
            ValueEstimators.MAGAE, gamma=self.gamma, lmbda=self.lmbda, average_gae=self.normalize_advantage and alone
        )
        return loss

    def standardises(self) -> Literal["batch"] | None:
        """Return that a batch's advantages are standardised, if they are."""
        return "batch" if self.normalize_advantage else None
