"""What a dispatcher radios: the action that a baseline which sees all would have each agent do next."""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.state import WorldState
from warp_torchrl.world.world import World


class _Given(NamedTuple):
    """Worlds that a heuristic reads, without an environment."""

    world: World
    world_state: WorldState


def orders(state: WorldState, world: World, dispatcher: str) -> Tensor:
    """Return the action that a heuristic, one of ``TEACHERS``, would choose for each agent, int64 [B, A]."""
    with torch.no_grad():
        return HEURISTICS[dispatcher](_Given(world, state)).choose(state, world.possible_actions(state))
