"""The paper's reward: an award for each act."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.env.reward.base import Reward
from warp_torchrl.world.arrays.distances import distance_to_nearest
from warp_torchrl.world.arrays.geometry import flood
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import Action, Transition


@dataclass(frozen=True, kw_only=True)
class Paper(Reward):
    """The paper's reward, an award for each act (WARP-CA, reward table), divided by ``divisor``.

    With the printed barrier of +50 for each tree cleared near fire, agents clear trees instead of fighting the fire. So
    the barrier pays 50 x the share of the initial trees that the step's clearing cuts off from the fire, split among
    the agents that cleared; ``barrier_rule: printed`` pays the printed award.

    Attributes:
        move: Award of each move, also a blocked one.
        extinguish: Award of each fire extinguished.
        failed: Award of each extinguish or clear without effect.
        clear: Award of each tree cleared.
        far_clear: Further award of each tree cleared farther than ``near`` from fire.
        barrier: Award of a barrier.
        barrier_rule: ``cut_off`` or ``printed``.
        near: Distance [cells].
        divisor: Divides the sum of all awards.
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
        """Return each agent's award before sharing and shaping, float32 [B, A]."""
        result, before = transition.result, transition.before
        action, cleared = result.action, result.cleared
        distance = distance_to_nearest(transition.after.vehicles.position, is_burning(before.cells))
        is_near = distance <= self.near
        failed = (action == int(Action.EXTINGUISH)) & ~result.extinguished
        failed |= (action == int(Action.CLEAR)) & ~cleared
        award = (
            self.move * (action <= int(Action.NORTH_WEST))
            + self.extinguish * result.extinguished
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
    return lost / transition.counts_before.initial
