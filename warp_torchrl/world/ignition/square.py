"""A square of fire in the middle of the map."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.ignition.ignition import IgnitionSource
from warp_torchrl.world.terrain.source import LandscapeSource, map_size


@dataclass(frozen=True, kw_only=True)
class MiddleSquare(IgnitionSource):
    """All trees of a square in the middle of the map, the same in every episode.

    Attributes:
        side: Of the square [cells].
        head_start: Fire ticks before the team's first step.

    Raises:
        ValueError: If a value is out of its range.
    """

    side: int = 4
    head_start: int = 0

    def __post_init__(self) -> None:
        check_fields(self, side=(1, 4096), head_start=(0, 1000))

    def over(self, landscape: LandscapeSource) -> "MiddleSquare":
        """Return this ignition.

        Raises:
            ValueError: If the square is larger than the map.
        """
        if self.side > min(map_size(landscape.size)):
            raise ValueError(f"ignition.side must fit on the map of {map_size(landscape.size)}, got {self.side}")
        return self

    def __call__(self, key: Tensor, fuel: Tensor) -> Tensor:
        """Return the cells to light, bool [B, H, W]: fuel of the square."""
        height, width = fuel.shape[1:]
        top, left = (height - self.side) // 2, (width - self.side) // 2
        lit = torch.zeros_like(fuel)
        lit[:, top : top + self.side, left : left + self.side] = True
        return lit & fuel

    @property
    def why_dark(self) -> str:
        """Return the message for a world without a cell to light."""
        return f"ignition.side must reach a tree that can burn, a map has none in its middle {self.side} x {self.side}"
