"""Proximal policy optimisation for teams: MAPPO with a central critic, IPPO with local ones, from TorchRL's loss.

Yu et al., "The Surprising Effectiveness of PPO in Cooperative Multi-Agent Games", 2022; Schulman et al., "Proximal
Policy Optimization Algorithms", 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor
from torchrl.modules import MaskedCategorical, PopArtValueNorm, ProbabilisticActor
from torchrl.objectives.multiagent import IPPOLoss, MAPPOLoss

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.on_policy import LOSS_ENTRIES, OnPolicy


class SharedValueNorm(PopArtValueNorm):
    """TorchRL's running statistics of value targets, over those of all processes.

    The loss calls ``update`` at each minibatch, when all processes would have to wait for each other. So ``update``
    does nothing, and ``learn`` takes the moments, which ``moments`` computes for many minibatches with one message.
    """

    def update(self, value_target: Tensor) -> None:
        """Do nothing: ``learn`` updates the statistics."""

    def moments(self, targets: Sequence[Tensor]) -> Tensor:
        """Return the mean and the mean square of value targets, float32 [..., 1], over all processes, [n, 2, 1]."""
        found = torch.stack([torch.stack((each.mean(), each.square().mean())) for each in targets])[..., None]
        parallel.mean_([found])  # as many targets in every process
        return found

    def learn(self, moments: Tensor) -> None:
        """Update the statistics by the mean and the mean square of value targets, [2, 1]."""
        for running, now in zip((self.running_mean, self.running_mean_sq), moments, strict=True):
            running.mul_(self.beta).add_(now, alpha=1.0 - self.beta)
        self.debiasing_term.mul_(self.beta).add_(1.0 - self.beta)


class _MaskedEntropy:
    """The entropy of masked actions, without a check that it is finite.

    TorchRL's losses check it at each update, which is a synchronisation.
    """

    def _get_entropy(self, dist: MaskedCategorical, adv_shape: torch.Size) -> Tensor:
        return dist.entropy().unsqueeze(-1)


class MaskedMappo(_MaskedEntropy, MAPPOLoss):
    """TorchRL's MAPPO loss of masked actions."""


class MaskedIppo(_MaskedEntropy, IPPOLoss):
    """TorchRL's IPPO loss of masked actions."""


@dataclass(frozen=True, kw_only=True)
class Ppo(OnPolicy):
    """Clipped PPO with multi-agent generalised advantage estimation.

    Attributes:
        clip_epsilon: Clip range of the probability ratio.
        value_norm: Whether value targets are normalised by running statistics.
        epochs: Passes over each batch.

    Raises:
        ValueError: If a value is out of its range.
    """

    clip_epsilon: float = 0.2
    value_norm: bool = True
    epochs: int = 3

    def __post_init__(self) -> None:
        self.check(clip_epsilon=(1e-4, 1.0), epochs=(1, 1000))

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> MAPPOLoss:
        """Return TorchRL's MAPPO or IPPO loss."""
        loss_class = MaskedMappo if self.central_critic else MaskedIppo
        alone = parallel.size() == 1
        norm = PopArtValueNorm if alone else SharedValueNorm
        loss = loss_class(
            policy,
            critic,
            clip_epsilon=self.clip_epsilon,
            entropy_coeff=self.entropy_coeff,
            critic_coeff=self.critic_coeff,
            value_norm=norm(shape=1) if self.value_norm else None,
            normalize_advantage=alone,  # else ``standardises`` has it
        )
        loss.set_keys(**LOSS_ENTRIES)
        loss.make_value_estimator(gamma=self.gamma, lmbda=self.lmbda)
        return loss

    def standardises(self) -> Literal["minibatch"]:
        """Return that each minibatch's advantages are standardised."""
        return "minibatch"

    def passes(self) -> int:
        """Return the epochs."""
        return self.epochs

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return super().columns() | {
            "kl_approx": "train/approx_kl",
            "clip_fraction": "train/clip_fraction",
        }

    def constants(self) -> dict[str, float]:
        """Return the clip range."""
        return {"train/clip_range": self.clip_epsilon}
