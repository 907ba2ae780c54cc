"""Soft actor-critic for discrete actions, from TorchRL's loss.

Haarnoja et al., "Soft Actor-Critic", 2018; Christodoulou, "Soft Actor-Critic for Discrete Action Settings", 2019.
"""

from dataclasses import dataclass

import torch
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import DiscreteSACLoss, ValueEstimators

from warp_torchrl.algorithms.algorithm import masked_actor
from warp_torchrl.algorithms.off_policy import AGENT_KEYS, OffPolicy
from warp_torchrl.models import ACTION, ACTION_VALUE, Mlp, Signature, over_canonical


@dataclass(frozen=True, kw_only=True)
class Sac(OffPolicy):
    """Discrete SAC: each agent's actor against the smaller of two local action values; it explores by sampling.

    Attributes:
        temperature: Initial weight of the entropy; it is learned.
        target_entropy: Target of the entropy, as a share of the entropy of a uniform choice among all actions.

    Raises:
        ValueError: If a value is out of its range, or prioritised replay does not work here.
    """

    updates: int = 128
    temperature: float = 0.01
    target_entropy: float = 0.2

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        super().check(temperature=(1e-6, 100.0), target_entropy=(0.0, 1.0), **ranges)

    def policy(self, shape: Signature, model: Mlp) -> ProbabilisticActor:
        """Return the team's decentralised policy: each agent's action is drawn from its observation and mask."""
        # The loss multiplies log-probabilities by probabilities: -inf for a masked action would give nan.
        return masked_actor(shape, model, neg_inf=-1e4)

    def loss(self, policy: ProbabilisticActor, shape: Signature, model: Mlp, device: torch.device) -> DiscreteSACLoss:
        """Return TorchRL's loss with its value estimator."""
        loss = DiscreteSACLoss(
            over_canonical(policy, restored=True),
            [over_canonical(model.action_value(shape), restored=True).to(device) for _ in range(2)],
            action_space="categorical",
            num_actions=shape.n_actions,
            num_qvalue_nets=2,
            loss_function="smooth_l1",
            alpha_init=self.temperature,
            target_entropy_weight=self.target_entropy,
            deactivate_vmap=True,  # the networks compute in their own arithmetic, which vmap does not follow
        )
        loss.set_keys(action=ACTION, action_value=ACTION_VALUE, **AGENT_KEYS)
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.gamma)
        return loss

    def loss_keys(self) -> tuple[str, ...]:
        """Return the entries of the loss's output that are summed and minimised."""
        return ("loss_actor", "loss_qvalue", "loss_alpha")

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {
            "loss_actor": "train/policy_gradient_loss",
            "loss_qvalue": "train/value_loss",
            "loss_alpha": "train/temperature_loss",
            "alpha": "train/temperature",
            "entropy": "train/entropy",
        }
