"""A lab's own scenario, reward, channel, wind, baseline and learner: ``warp train plugins=[my_lab] scenario=gap``."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import PPOLoss, ValueEstimators

from warp_torchrl import Heuristic, Look, OnPolicy, Reward, Transition, Uniform, WorldState, add_scenario, register
from warp_torchrl.algorithms.on_policy import LOSS_ENTRIES
from warp_torchrl.heuristics.base import extinguish_or, idle_action


@register("reward")
@dataclass(frozen=True, kw_only=True)
class Alight(Reward):
    """Minus the area under the fire's curve: -cost x burning cells / N0 in each step."""

    cost: float = 0.1

    def own(self, transition: Transition) -> Tensor:
        """Return what each agent earns, float32 [B, A]."""
        counts = transition.counts_after
        return (-self.cost * counts.alight / counts.initial)[:, None].expand(transition.result.action.shape)


@register("channel")
def sapling(look: Look) -> Tensor:
    """Return 255 where a tree is too young to ignite."""
    return ((look.cells >= 1) & (look.cells < look.world.fire.youngest_fuel)) * 255


@register("wind")
@dataclass(frozen=True, kw_only=True)
class ColdFront(Uniform):
    """A wind that turns round after tick ``at``."""

    at: int = 10
    changes = True

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the wind of each world after a tick, float32 [B, 2, 1, 1] [m/s]."""
        return torch.where((state.tick == self.at)[:, None, None, None], -state.wind, state.wind)


@register("heuristic")
class Sentry(Heuristic):
    """Stays where it is, and extinguishes what it can reach."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        return extinguish_or(idle_action(mask, self.world.team), mask)


@register("algorithm")
@dataclass(frozen=True, kw_only=True)
class Surrogate(OnPolicy):
    """PPO without its clip: TorchRL's loss, and how often each batch is seen."""

    epochs: int = 1

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> PPOLoss:
        """Return the loss, with an estimator that gives a team's end to each agent."""
        loss = PPOLoss(policy, critic, entropy_coeff=self.entropy_coeff, critic_coeff=self.critic_coeff)
        loss.set_keys(**LOSS_ENTRIES)
        loss.make_value_estimator(ValueEstimators.MAGAE, gamma=self.gamma, lmbda=self.lmbda, average_gae=True)
        return loss

    def passes(self) -> int:
        """Return the epochs."""
        return self.epochs


SEEN = "off_map, fire_stage, ash, firebreak, wet, threat, other_ugv, sapling"
add_scenario(
    "gap",
    ["wind=cold_front", "reward=alight", "landscape.size=24", "team.n_agents=3", f"observation.channels=[{SEEN}]"],
)
