"""Orders: the action that a heuristic would have each agent do next.

Of a heuristic that sees all they are what a dispatcher radios; of one that knows what its agents know, a rule of thumb.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.world.state import WorldState
from warp_torchrl.world.world import World


class _Given(NamedTuple):
    """Worlds that a heuristic reads, without an environment."""

    world: World
    world_state: WorldState


def orders(state: WorldState, world: World, by: str) -> Tensor:
    """Return the action that a heuristic, one of ``TEACHERS``, would choose for each agent, int64 [B, A]."""
    with torch.no_grad():
        return HEURISTICS[by](_Given(world, state)).choose(state, world.possible_actions(state))


def check_orders(by: str) -> None:
    """Check that there is a heuristic of a name that can give orders.

    Raises:
        ValueError: If there is none.
    """
    if by not in TEACHERS:
        raise ValueError(f"orders must be null or one of {', '.join(TEACHERS)}, got {by}{did_you_mean(by, TEACHERS)}")


def check_knows(by: str, world: World) -> None:
    """Check that a heuristic tells agents nothing of fire that they may not know.

    Raises:
        ValueError: If it sees all, and their sight is limited.
    """
    if world.sensing.is_limited and HEURISTICS[by].sees_all:
        known = ", ".join(name for name in TEACHERS if not HEURISTICS[name].sees_all)
        raise ValueError(f"observation.orders must be null or one of {known} where sight is limited, got {by}")
