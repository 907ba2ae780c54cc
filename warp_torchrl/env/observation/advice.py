"""Advice: the action that a heuristic would have each agent do next.

It is what a dispatcher radios, who knows what the team knows, see ``Heuristic.act``.
Agents learn when to take it. The word is that of Torrey and Taylor, "Teaching on a Budget: Agents Advising Agents in
Reinforcement Learning", AAMAS 2013.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World


class _Given(NamedTuple):
    """Worlds that a heuristic reads, without an environment."""

    world: World
    shared_state: WorldState


def advised_actions(state: WorldState, world: World, adviser: str) -> Tensor:
    """Return the action that a heuristic, one of ``TEACHERS``, would choose for each agent, int64 [B, A]."""
    with torch.no_grad():
        return HEURISTICS[adviser](_Given(world, state)).act(state, world.possible_actions(state))


def check_adviser(name: str) -> None:
    """Check that there is a heuristic of a name that can advise.

    Raises:
        ValueError: If there is none.
    """
    if name not in TEACHERS:
        hint = did_you_mean(name, TEACHERS)
        raise ValueError(f"advice must be null or one of {', '.join(TEACHERS)}, got {name}{hint}")
