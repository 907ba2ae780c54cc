"""Presence: which vehicles are on the scene. A mechanic may let them come and go; without it all are there."""

import torch
from torch import Tensor

from warp_torchrl.world.state.state import Action, WorldState

PRESENCE = "arrivals"
"""Name of the planes of the mechanic, whose ``present`` is bool [B, A]."""


def on_scene(state: WorldState) -> Tensor | None:
    """Return which vehicles are on the scene, bool [B, A]; None where all always are."""
    return state.plane(PRESENCE, "present")


def those_there(state: WorldState, which: Tensor) -> Tensor:
    """Return the vehicles of a mask, bool [A] or [B, A], that are on the scene."""
    there = on_scene(state)
    return which if there is None else which & there


def pairs_there(state: WorldState, pairs: Tensor) -> Tensor:
    """Return the pairs of a mask, bool [B or 1, A, A], with both vehicles on the scene."""
    there = on_scene(state)
    return pairs if there is None else pairs & there[:, :, None] & there[:, None, :]


def staying(state: WorldState, action: Tensor) -> Tensor:
    """Return actions, int64 [B, A], in which absent vehicles stay."""
    there = on_scene(state)
    return action if there is None else torch.where(there, action, int(Action.STAY))
