"""Planes of flags in bytes, as compiled functions need them."""

import torch

from warp_torchrl.world.state.state import WorldState

_FLAGS = ("initial", "extinguished", "burned", "firebreak")


def in_bytes(state: WorldState) -> WorldState:
    """Return worlds whose planes of flags are read as uint8, 0 and 1."""
    return state.replace(**{name: getattr(state, name).view(torch.uint8) for name in _FLAGS})


def in_flags(state: WorldState) -> WorldState:
    """Return the worlds of ``in_bytes`` with their flags as bool again."""
    return state.replace(**{name: getattr(state, name).view(torch.bool) for name in _FLAGS})
