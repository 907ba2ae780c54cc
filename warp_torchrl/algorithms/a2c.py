"""Advantage actor-critic for teams, from TorchRL's loss.

Mnih et al., "Asynchronous Methods for Deep Reinforcement Learning", 2016; its synchronous form.
"""

from dataclasses import dataclass
from typing import Any, Literal

import torch
from tensordict import TensorDictBase
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import A2CLoss, ValueEstimators

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.on_policy import LOSS_ENTRIES, OnPolicy


class ExplainedA2c(A2CLoss):
    """TorchRL's A2C loss, with the share of the targets' variance that the critic explains, as in its PPO loss.

    explained_variance = 1 - Var(target - value) / Var(target),     float32 [A, 1], over the sample
    """

    def __init__(self, actor: ProbabilisticActor, critic: torch.nn.Module, **options: Any) -> None:
        super().__init__(actor, critic, **options)
        self.critic_network.register_forward_hook(self._keep_value)

    def _keep_value(self, critic: torch.nn.Module, given: object, said: TensorDictBase) -> None:
        self._value = said.get(self.tensor_keys.value).detach()

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Return the terms of the loss, and the explained variance."""
        terms = super().forward(tensordict)
        target = tensordict.get(self.tensor_keys.value_target)
        rest, all_of_it = (each.var(dim=0, correction=0) for each in (target - self._value, target))
        return terms.set("explained_variance", 1.0 - rest / (all_of_it + torch.finfo(target.dtype).eps))


@dataclass(frozen=True, kw_only=True)
class A2c(OnPolicy):
    """A2C with multi-agent generalised advantage estimation: each batch is used once.

    Its minibatches are as many optimiser steps: small ones or short batches of the collector are best.

    Attributes:
        normalize_advantage: Whether each agent's advantages of a batch are standardised, as PPO's are.

    Raises:
        ValueError: If a value is out of its range.
    """

    entropy_coeff: float = 0.1
    entropy_coeff_end: float = 0.005
    critic_coeff: float = 0.5
    minibatch_size: int = 256
    normalize_advantage: bool = True

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> A2CLoss:
        """Return TorchRL's loss, with the estimator that gives a team's end to each agent."""
        loss = ExplainedA2c(
            policy,
            critic,
            entropy_coeff=self.entropy_coeff or 1.0,  # at 0 TorchRL would leave the term out for good
            critic_coeff=self.critic_coeff,
            loss_critic_type="l2",
        )
        loss.entropy_coeff.fill_(self.entropy_coeff)
        loss.set_keys(**LOSS_ENTRIES)
        alone = parallel.size() == 1  # else ``standardises`` has it
        loss.make_value_estimator(
            ValueEstimators.MAGAE, gamma=self.gamma, lmbda=self.lmbda, average_gae=self.normalize_advantage and alone
        )
        return loss

    def standardises(self) -> Literal["batch"] | None:
        """Return that a batch's advantages are standardised, if they are."""
        return "batch" if self.normalize_advantage else None
