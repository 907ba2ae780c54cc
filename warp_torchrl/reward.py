"""What the team earns: the paper's conservation rewards and its shaped one.

A reward is a component: called with a transition it returns [B, A, 1]. Every reward has a team share and can carry
potential-based shaping.
"""

from dataclasses import dataclass, fields
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.world.geometry import chebyshev_distance, flood, nearest
from warp_torchrl.world.state import (
    Action,
    Tally,
    Transition,
    WorldState,
    is_burning,
    is_tree,
)
from warp_torchrl.world.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class Reward:
    """What all rewards have in common.

        r_i = scale ((1 - share) own_i + share mean_j own_j)
        own_i += shaping (gamma Phi_i(s') - Phi_i(s)),  Phi_i = -0.5 d_i / H,  Phi(terminal) = 0

    with d_i the distance of agent i to the nearest fire. Such shaping leaves optimal policies unchanged (Ng, Harada
    and Russell 1999).

    Attributes:
        team_share: 1 gives every agent the team's mean, 0 each its own.
        scale: Factor on everything.
        shaping: Weight of the distance potential; 0 switches it off.
        gamma: Discount of the shaping; must be the learner's.

    Raises:
        ValueError: If a value is out of its range.
    """

    team_share: float = 1.0
    scale: float = 1.0
    shaping: float = 0.0
    gamma: float = 0.99

    def __post_init__(self) -> None:
        finite = {each.name: (-1e9, 1e9) for each in fields(self) if each.type in ("float", "int", float, int)}
        ranges = {"team_share": (0.0, 1.0), "scale": (1e-6, 1e6), "shaping": (0.0, 1e3), "gamma": (0.0, 1.0)}
        check_fields(self, **{**finite, **ranges})

    def __call__(self, transition: Transition) -> Tensor:
        """Return the reward of each agent, float32 [B, A, 1]; 0 in a world that had ended before."""
        own = self.own(transition)
        if self.shaping > 0.0:
            own = own + self.shaping * self._shaping(transition)
        mean = own.mean(dim=1, keepdim=True)
        reward = self.scale * ((1.0 - self.team_share) * own + self.team_share * mean)
        return (reward * ~transition.before.done[:, None])[..., None]

    def own(self, transition: Transition) -> Tensor:
        """Return what each agent earns before sharing and shaping, float32 [B, A]."""
        raise TypeError(f"{type(self).__name__} does not say what an agent earns: define own()")

    def _shaping(self, transition: Transition) -> Tensor:
        after = _distance_potential(transition.after) * ~transition.after.terminated[:, None]
        return self.gamma * after - _distance_potential(transition.before)


def _distance_potential(state: WorldState) -> Tensor:
    """Return -0.5 x distance to the nearest fire / H of each agent, 0 without fire, float32 [B, A]."""
    height = state.cells.shape[1]
    distance = chebyshev_distance(state.vehicles.position, is_burning(state.cells)).amin((2, 3))
    return -0.5 / height * distance * (state.tally.alight > 0)[:, None]


@dataclass(frozen=True, kw_only=True)
class Efficiency(Reward):
    """Conservation reward 1: keep and save trees, with few actions.

        R = (w_p T_p + w_e T_e - w_c T_c - w_b T_b) / N0 - w_a A_total      (WARP-CA, conservation metric)

    telescoped, r_t = R(t) - R(t-1). The trees are the team's; each agent pays for its own acts, as many times as
    there are agents, so that the team's mean is R.

    Attributes:
        preserved: w_p, weight of each tree untouched by fire or agents [1 / initial tree].
        extinguished: w_e, of each that was put out and stands.
        cleared: w_c, of each that was cleared.
        burned: w_b, of each that burned to ash.
        act: w_a, of each extinguish or clear action [1].
    """

    preserved: float = 1.0
    extinguished: float = 0.9
    cleared: float = 0.5
    burned: float = 1.0
    act: float = 5e-4

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's part, float32 [B, A]."""
        before, after = transition.before, transition.after
        gained = self._worth(after.tally) - self._worth(before.tally)
        acts = after.vehicles.acts - before.vehicles.acts
        return gained[:, None] - self.act * acts.shape[1] * acts

    def _worth(self, tally: Tally) -> Tensor:
        worth = (
            self.preserved * tally.preserved
            + self.extinguished * tally.extinguished
            - self.cleared * tally.cleared
            - self.burned * tally.burned
        )
        return worth / tally.initial


@dataclass(frozen=True, kw_only=True)
class Paper(Reward):
    """The paper's reward, an award for each act (WARP-CA, reward table), divided by ``divisor``.

    A barrier of +50 for each tree cleared near fire, as printed, is farmed: agents clear instead of fighting. So the
    barrier pays 50 x the share of the initial trees that the step's clearing cuts off from the fire, split among the
    agents that cleared; ``barrier_rule: printed`` pays the printed one.

    Attributes:
        move: Of each move, blocked ones too.
        extinguish: Of each fire put out.
        failed: Of each extinguish or clear that did nothing.
        clear: Of each tree cleared.
        far_clear: Of each tree cleared farther than ``near`` from fire, added.
        barrier: Of a barrier.
        barrier_rule: ``cut_off`` or ``printed``.
        near: Distance [cells].
        divisor: Of all of it.
    """

    move: float = -0.2
    extinguish: float = 10.0
    failed: float = -1.0
    clear: float = 1.0
    far_clear: float = -2.0
    barrier: float = 50.0
    barrier_rule: Literal["cut_off", "printed"] = "cut_off"
    near: int = 3
    divisor: float = 50.0

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's part, float32 [B, A]."""
        outcome, before = transition.outcome, transition.before
        action, cleared = outcome.action, outcome.cleared
        distance, _ = nearest(transition.after.vehicles.position, is_burning(before.cells))
        is_near = distance <= self.near
        failed = (action == Action.EXTINGUISH) & ~outcome.extinguished
        failed |= (action == Action.CLEAR) & ~cleared
        award = (
            self.move * (action <= Action.NORTH_WEST)
            + self.extinguish * outcome.extinguished
            + self.failed * failed
            + self.clear * cleared
            + self.far_clear * (cleared & ~is_near)
        )
        if self.barrier_rule == "printed":
            barrier = (cleared & is_near).to(torch.float32)
        else:
            builders = cleared.sum(1, keepdim=True).clamp(min=1)
            barrier = _cut_off(transition)[:, None] * cleared / builders
        return (award + self.barrier * barrier) / self.divisor


def _cut_off(transition: Transition) -> Tensor:
    """Return the share of the initial trees that this step's clearing separates from the fire, float32 [B].

    The cleared cells themselves do not count.
    """
    before, after = transition.before, transition.after
    new_break = after.firebreak & ~before.firebreak
    fire = is_burning(before.cells)
    fuel = is_tree(before.cells) & (before.alpha > 0.0) & ~new_break
    threatened = flood(torch.cat((fire, fire)), torch.cat((fuel | new_break, fuel)))
    was, still = (threatened & torch.cat((fuel, fuel))).chunk(2)
    lost = was.sum((1, 2)) - still.sum((1, 2))
    return lost / before.tally.initial
