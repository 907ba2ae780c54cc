"""The surrogate objective for teams, unclipped, from TorchRL's loss.

L^CPI in Schulman et al., "Proximal Policy Optimization Algorithms", 2017; Kakade and Langford, "Approximately Optimal
Approximate Reinforcement Learning", 2002.
"""

from dataclasses import dataclass

import torch
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import PPOLoss, ValueEstimators

from warp_torchrl.algorithms.on_policy import LOSS_ENTRIES, OnPolicy


@dataclass(frozen=True, kw_only=True)
class Surrogate(OnPolicy):
    """PPO without its clip: safe for few epochs and small steps alone.

    Attributes:
        epochs: Passes over each batch.

    Raises:
        ValueError: If a value is out of its range.
    """

    epochs: int = 1

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        super().check(epochs=(1, 1000), **ranges)

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> PPOLoss:
        """Return TorchRL's loss, with the estimator that gives a team's end to each agent."""
        loss = PPOLoss(policy, critic, entropy_coeff=self.entropy_coeff, critic_coeff=self.critic_coeff)
        loss.set_keys(**LOSS_ENTRIES)
        loss.make_value_estimator(ValueEstimators.MAGAE, gamma=self.gamma, lmbda=self.lmbda, average_gae=True)
        return loss

    def passes(self) -> int:
        """Return the epochs."""
        return self.epochs

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return super().columns() | {"kl_approx": "train/approx_kl", "explained_variance": "train/explained_variance"}
