"""Sources of landscapes.

A source has a ``size`` (H, W) and, called with world keys, returns the ``Landscape`` of each world's episode.
"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from torch import Tensor

from warp_torchrl.world.state.state import Landscape

LARGEST_SIDE = 4096
"""Longest side of a simulated map [cells]."""


@runtime_checkable
class LandscapeSource(Protocol):
    """Interface of a landscape component."""

    @property
    def size(self) -> tuple[int, int] | int:
        """Return the map's (H, W), or its side where it is square [cells]."""
        ...

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world, from int64 keys [B]."""
        ...


def map_size(size: tuple[int, int] | int) -> tuple[int, int]:
    """Return (H, W) of a size given as a side or as a pair.

    Raises:
        ValueError: If a side is not in 4..4096.
    """
    sides = (size, size) if isinstance(size, int) else size
    fits = isinstance(sides, Sequence) and not isinstance(sides, str) and len(sides) == 2
    if not fits or not all(type(side) is int and 4 <= side <= LARGEST_SIDE for side in sides):
        raise ValueError(f"size must be one side or [rows, columns], each in 4..{LARGEST_SIDE} cells, got {size}")
    height, width = sides
    return height, width
