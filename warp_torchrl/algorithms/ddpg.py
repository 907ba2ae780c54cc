"""Deep deterministic policy gradient for discrete actions, from TorchRL's loss, with straight-through one-hot actions.

Lillicrap et al., "Continuous control with deep reinforcement learning", 2016; Lowe et al., "Multi-Agent Actor-Critic
for Mixed Cooperative-Competitive Environments" (MADDPG), 2017; Jang et al., "Categorical Reparameterization with
Gumbel-Softmax", 2017.
"""

from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
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


class PenalisedDdpg(DDPGLoss):
    """TorchRL's DDPG loss with a penalty on the actor's logits, and the actor's entropy.

        loss_actor = -mean Q + penalty * mean (logit^2 of the open actions)

    The mean is over an agent's open actions, then over agents and samples. Without the penalty logits grow until one
    action is certain, where no gradient comes through the softmax. Lowe et al. penalise logits so in their code of
    MADDPG (openai/maddpg, ``p_reg``).

    Args:
        actor: Writes logits float32 [..., actions], and reads masks bool of their shape and order.
        critic: Writes the value of the actor's choice.
        logit_penalty: Weight of the penalty.
        options: Of TorchRL's loss.
    """

    def __init__(
        self, actor: TensorDictModuleBase, critic: TensorDictModuleBase, *, logit_penalty: float, **options: Any
    ) -> None:
        super().__init__(actor, critic, **options)
        self.logit_penalty = logit_penalty
        self.actor_network.register_forward_hook(self._keep_logits)

    def _keep_logits(self, actor: TensorDictModuleBase, given: object, said: TensorDictBase) -> None:
        self._logits, self._mask = said.get(LOGITS), said.get(ACTION_MASK)

    def loss_actor(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the actor's loss, and the mean entropy [nat] of the softmax of the open actions' logits."""
        loss, told = super().loss_actor(tensordict)
        logits, mask = self._logits, self._mask  # of the actor's last call, which was this loss's
        self._logits = self._mask = None  # else they would keep the graph
        size = logits.masked_fill(~mask, 0.0).square().sum(dim=-1) / mask.sum(dim=-1)
        weights = self._maybe_get_priority_weight(tensordict)
        penalty = self._reduce_loss(size, tensordict=tensordict, weights=weights)
        shares = torch.softmax(logits.detach().masked_fill(~mask, -1e4), dim=-1)
        entropy = torch.special.entr(shares).sum(dim=-1).mean()
        return loss + self.logit_penalty * penalty, {**told, "entropy": entropy}


@dataclass(frozen=True, kw_only=True)
class Ddpg(EpsilonGreedy):
    """DDPG with one-hot actions: the critic judges the action that the actor chose, and its gradient moves the actor.

    Attributes:
        central_critic: The critic reads the whole state and the team's joint action (MADDPG), or each agent's own
            observation and action.
        temperature: Of the softmax that the gradient goes through.
        logit_penalty: Weight of the mean square of the open actions' logits in the actor's loss (Lowe et al., 2017, in
            their code).

    Raises:
        ValueError: If a value is out of its range, or prioritised replay does not work here.
    """

    updates: int = 128
    tau: float = 0.05
    central_critic: bool = False
    temperature: float = 1.0
    logit_penalty: float = 1e-3

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        super().check(temperature=(1e-3, 100.0), logit_penalty=(0.0, 1000.0), **ranges)

    def policy(self, shape: Signature, model: Mlp) -> TensorDictSequential:
        """Return the team's decentralised policy: each agent's action depends on its observation and mask."""
        choose = TensorDictModule(
            OneHotChoice(self.temperature), in_keys=[LOGITS, ACTION_MASK], out_keys=[ACTION, ACTION_ONE_HOT]
        )
        return TensorDictSequential(model.actor(shape), choose)

    def explorer(self, policy: TensorDictModuleBase, shape: Signature) -> TensorDictSequential:
        """Return the epsilon-greedy policy, which also writes the one-hot of the final action."""
        told = TensorDictModule(_OneHot(shape.n_actions), in_keys=[ACTION], out_keys=[ACTION_ONE_HOT])
        return TensorDictSequential(policy, self.epsilon_greedy(shape, self.epsilon), told)

    def loss(self, policy: TensorDictModuleBase, shape: Signature, model: Mlp, device: torch.device) -> PenalisedDdpg:
        """Return TorchRL's loss with the penalty and its value estimator."""
        critic = over_canonical(model.action_critic(shape, self.central_critic), restored=True).to(device)
        loss = PenalisedDdpg(
            over_canonical(policy, restored=True),
            critic,
            logit_penalty=self.logit_penalty,
            delay_actor=True,
            delay_value=True,
            loss_function="smooth_l1",
        )
        loss.set_keys(state_action_value=STATE_ACTION_VALUE, **AGENT_KEYS)
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.gamma)
        return loss

    def loss_keys(self) -> tuple[str, ...]:
        """Return the entries of the loss's output that are summed and minimised."""
        return ("loss_actor", "loss_value")

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {
            "loss_actor": "train/policy_gradient_loss",
            "loss_value": "train/value_loss",
            "entropy": "train/entropy",
        }
