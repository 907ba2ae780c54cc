"""Deep deterministic policy gradient for discrete actions, from TorchRL's loss, with straight-through one-hot actions.

Lillicrap et al., "Continuous control with deep reinforcement learning", 2016; Lowe et al., "Multi-Agent Actor-Critic
for Mixed Cooperative-Competitive Environments" (MADDPG), 2017; Jang et al., "Categorical Reparameterization with
Gumbel-Softmax", 2017.
"""

from dataclasses import dataclass

import torch
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs.utils import ExplorationType, exploration_type
from torchrl.objectives import DDPGLoss, ValueEstimators

from warp_torchrl.algorithms.off_policy import AGENT_KEYS, EpsilonGreedy
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    ACTION_ONE_HOT,
    LOGITS,
    STATE_ACTION_VALUE,
    Mlp,
    Signature,
    over_canonical,
)


class OneHotChoice(nn.Module):
    """Chooses an action and lets the gradient through to the logits of all, as softmax would.

    The highest logit is chosen; where TorchRL's exploration type is ``RANDOM``, after Gumbel noise, which draws it
    from their softmax.

    Args:
        temperature: Of the softmax whose gradient is used.
    """

    def __init__(self, temperature: float) -> None:
        super().__init__()
        self.temperature = temperature

    def forward(self, logits: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Return actions int64 [...] and one-hot float32 [..., actions] of logits and masks [..., actions]."""
        logits = logits.masked_fill(~mask, -1e4)
        if exploration_type() == ExplorationType.RANDOM:
            logits = logits - torch.empty_like(logits).exponential_().log()
        soft = torch.softmax(logits / self.temperature, dim=-1)
        action = logits.argmax(dim=-1)
        hard = nn.functional.one_hot(action, logits.shape[-1]).to(soft.dtype)
        return action, hard + (soft - soft.detach())


class _OneHot(nn.Module):
    def __init__(self, n_actions: int) -> None:
        super().__init__()
        self.n_actions = n_actions

    def forward(self, action: Tensor) -> Tensor:
        """Return float32 [..., actions] of actions int64 [...]."""
        return nn.functional.one_hot(action, self.n_actions).to(torch.float32)


@dataclass(frozen=True, kw_only=True)
class Ddpg(EpsilonGreedy):
    """DDPG with one-hot actions: the critic judges the action that the actor chose, and its gradient moves the actor.

    Attributes:
        central_critic: The critic reads the whole state and the team's joint action (MADDPG), or each agent's own
            observation and action.
        temperature: Of the softmax that the gradient goes through.

    Raises:
        ValueError: If a value is out of its range, or prioritised replay does not work here.
    """

    central_critic: bool = False
    temperature: float = 1.0

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        super().check(temperature=(1e-3, 100.0), **ranges)

    def policy(self, shape: Signature, model: Mlp) -> TensorDictSequential:
        """Return the team's decentralised policy: each agent's action from its own observation and mask."""
        choose = TensorDictModule(
            OneHotChoice(self.temperature), in_keys=[LOGITS, ACTION_MASK], out_keys=[ACTION, ACTION_ONE_HOT]
        )
        return TensorDictSequential(model.actor(shape), choose)

    def explorer(self, policy: TensorDictModuleBase, shape: Signature) -> TensorDictSequential:
        """Return the epsilon-greedy policy, which also writes the one-hot of the final action."""
        told = TensorDictModule(_OneHot(shape.n_actions), in_keys=[ACTION], out_keys=[ACTION_ONE_HOT])
        return TensorDictSequential(policy, self.epsilon_greedy(shape, self.epsilon), told)

    def loss(self, policy: TensorDictModuleBase, shape: Signature, model: Mlp, device: torch.device) -> DDPGLoss:
        """Return TorchRL's loss with its value estimator."""
        critic = over_canonical(model.action_critic(shape, self.central_critic), restored=True).to(device)
        loss = DDPGLoss(
            over_canonical(policy, restored=True), critic, delay_actor=True, delay_value=True, loss_function="smooth_l1"
        )
        loss.set_keys(state_action_value=STATE_ACTION_VALUE, **AGENT_KEYS)
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.gamma)
        return loss

    def loss_keys(self) -> tuple[str, ...]:
        """Return the entries of the loss's output that are summed and minimised."""
        return ("loss_actor", "loss_value")

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {"loss_actor": "train/policy_gradient_loss", "loss_value": "train/value_loss"}
