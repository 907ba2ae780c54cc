"""Base class of rewards: team share, scale and potential-based shaping."""

from dataclasses import dataclass, fields
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.distances import distance_to_nearest
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.front import exposure
from warp_torchrl.world.state.state import Transition, TreeCounts, WorldState
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class Reward:
    """A reward, called with a transition.

        r_i = scale ((1 - share) own_i + share team),   team = mean_j own_j, or sum_j own_j
        own_i += shaping (gamma Phi_i(s') - Phi_i(s)),  Phi(terminal) = 0

    Such shaping leaves optimal policies unchanged (Ng, Harada and Russell 1999).

    Attributes:
        team_share: 1 gives every agent the team's reward, 0 its individual one.
        team_reward: The team's reward: the ``mean`` of its agents' individual rewards, or their ``sum``, A times as
            much.
        scale: Factor on everything.
        shaping: Weight of the potential; 0 switches it off.
        potential: ``distance``, Phi_i = -0.5 x agent i's distance to the nearest fire / H; or ``exposure``, Phi = -0.5
            x the share of the initial trees that can burn within three cells of fire.
        gamma: Discount of the shaping; must be the learner's.
        normalise: Whether training divides rewards by the running standard deviation of their discounted sum.

    Raises:
        ValueError: If a value is out of its range.
    """

    team_share: float = 1.0
    team_reward: Literal["mean", "sum"] = "mean"
    scale: float = 1.0
    shaping: float = 1.0
    potential: Literal["distance", "exposure"] = "distance"
    gamma: float = 0.99
    normalise: bool = False

    def __post_init__(self) -> None:
        finite = {each.name: (-1e9, 1e9) for each in fields(self) if each.type in ("float", "int", float, int)}
        ranges = {"team_share": (0.0, 1.0), "scale": (1e-6, 1e6), "shaping": (0.0, 1e3), "gamma": (0.0, 1.0)}
        check_fields(self, **{**finite, **ranges})

    def __call__(self, transition: Transition) -> Tensor:
        """Return the reward of each agent, float32 [B, A, 1]; 0 in a world that had already ended."""
        own = self.own(transition)
        if self.shaping > 0.0:
            own = own + self.shaping * self._shaping(transition)
        team = own.mean(dim=1, keepdim=True) if self.team_reward == "mean" else own.sum(dim=1, keepdim=True)
        reward = self.scale * ((1.0 - self.team_share) * own + self.team_share * team)
        return (reward * ~transition.before.done[:, None])[..., None]

    def check_world(self, world: World) -> None:
        """Check that the reward can be computed in a world.

        Raises:
            ValueError: If it cannot; this one can everywhere.
        """

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        raise TypeError(f"{type(self).__name__} does not say what an agent earns: define own()")

    def phi(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return the potential of each agent, float32 [B, A]; 0 where nothing burns."""
        if self.potential == "exposure":
            return (-0.5 * exposure(state, counts))[:, None].expand(-1, state.vehicles.position.shape[1])
        height = state.cells.shape[1]
        distance = distance_to_nearest(state.vehicles.position, is_burning(state.cells))
        return -0.5 / height * distance * (counts.alight > 0)[:, None]

    def _shaping(self, transition: Transition) -> Tensor:
        after = self.phi(transition.after, transition.counts_after) * ~transition.after.terminated[:, None]
        return self.gamma * after - self.phi(transition.before, transition.counts_before)


def near_misses(transition: Transition) -> Tensor:
    """Return 1 for each aircraft that ends the step with a near miss, float32 [B, A]; 0 without a separation."""
    before, after = (state.plane("flight", "near_misses") for state in (transition.before, transition.after))
    if before is None or after is None:
        return torch.zeros_like(transition.after.vehicles.position[..., 0], dtype=torch.float32)
    return (after - before).to(torch.float32)
