"""Where the fire starts."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.geometry import grow
from warp_torchrl.world.random import Stream, uniform


@dataclass(frozen=True, kw_only=True)
class Ignition:
    """Square patches of fire round cells drawn in the middle of the map.

    Attributes:
        count: Fires.
        radius: A fire is the trees within this many cells of its centre (1: a 3 x 3 patch).
        region: Share of the map's height and width, about the middle, in which centres lie.
        head_start: Fire ticks before the team's first step.

    Raises:
        ValueError: If a value is out of its range.
    """

    count: int = 1
    radius: int = 1
    region: float = 0.6
    head_start: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 64:
            raise ValueError(f"count must be in 1..64, got {self.count}")
        if not 0 <= self.radius <= 8:
            raise ValueError(f"radius must be in 0..8 cells, got {self.radius}")
        if not 0.0 < self.region <= 1.0:
            raise ValueError(f"region must be in (0, 1], got {self.region}")
        if not 0 <= self.head_start <= 1000:
            raise ValueError(f"head_start must be in 0..1000 ticks, got {self.head_start}")

    def __call__(self, key: Tensor, fuel: Tensor) -> Tensor:
        """Return the cells to light, bool [B, H, W]: fuel only, and at least one where a map has fuel.

        Centres are fuel cells of the region; a map without any there is lit elsewhere.

        Args:
            key: World keys, int64 [B].
            fuel: Trees that can ignite, bool [B, H, W].
        """
        worlds, height, width = fuel.shape
        score = uniform(key, 0, Stream.IGNITION, (height, width))
        score = score + (fuel & self._middle(height, width, fuel.device)) * 1.0 + fuel * 2.0
        best = score.flatten(1).topk(self.count, dim=1)
        centres = torch.zeros(worlds, height * width, dtype=torch.bool, device=fuel.device)
        centres.scatter_(1, best.indices, best.values >= 2.0)
        return grow(centres.view_as(fuel), self.radius) & fuel

    def _middle(self, height: int, width: int, device: torch.device) -> Tensor:
        rows = (torch.arange(height, device=device) + 0.5) / height - 0.5
        columns = (torch.arange(width, device=device) + 0.5) / width - 0.5
        half = self.region / 2.0
        return (rows.abs() <= half)[:, None] & (columns.abs() <= half)[None, :]
