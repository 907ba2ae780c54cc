"""Ignition sources: the cells where fires start."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.terrain.source import LandscapeSource, map_size

_FEW = 4  # fires, whose places are found faster one by one than by topk


class IgnitionSource(ABC):
    """Interface of an ignition component."""

    @property
    @abstractmethod
    def head_start(self) -> int:
        """Return the fire ticks before the team's first step."""

    @abstractmethod
    def __call__(self, key: Tensor, fuel: Tensor) -> Tensor:
        """Return the cells to light, bool [B, H, W], of fuel only.

        Args:
            key: World keys, int64 [B].
            fuel: Trees that can ignite, bool [B, H, W].
        """

    @abstractmethod
    def over(self, landscape: LandscapeSource) -> Self:
        """Return the ignition on a landscape's map.

        Raises:
            ValueError: If it does not fit there.
        """

    @property
    def why_dark(self) -> str:
        """Return the message for a world without a cell to light."""
        return "landscape: a map has no tree that can burn, so there is no fire to start"


@dataclass(frozen=True, kw_only=True)
class Ignition(IgnitionSource):
    """Square patches of fire round cells drawn in the middle of the map.

    Attributes:
        count: Fires.
        radius: A fire is the trees within this many cells of its centre (1: a 3 x 3 patch).
        region: Share of the map's height and width, about the middle, in which centres lie.
        head_start: Fire ticks before the team's first step; a fire that is down to embers waits, so that the team
            finds it alive.

    Raises:
        ValueError: If a value is out of its range.
    """

    count: int = 2
    radius: int = 1
    region: float = 0.6
    head_start: int = 1

    def __post_init__(self) -> None:
        check_fields(self, count=(1, 64), radius=(0, 8), region=(1e-6, 1.0), head_start=(0, 1000))

    def over(self, landscape: LandscapeSource) -> "Ignition":
        """Return this ignition.

        Raises:
            ValueError: If there are more fires than a quarter of the map's cells.
        """
        height, width = map_size(landscape.size)
        if self.count > height * width // 4:
            cells = f"a quarter of the map's {height * width} cells"
            raise ValueError(f"ignition.count must be at most {cells}, got {self.count}")
        return self

    def __call__(self, key: Tensor, fuel: Tensor) -> Tensor:
        """Return the cells to light, bool [B, H, W]: fuel only, and at least one where a map has fuel.

        Centres are fuel cells of the region; a map without any there is lit elsewhere.

        Args:
            key: World keys, int64 [B].
            fuel: Trees that can ignite, bool [B, H, W].
        """
        worlds, height, width = fuel.shape
        score = uniform(key, 0, Stream.IGNITION, (height, width)).mul_(1 << 24).to(torch.int64)
        score.add_(fuel, alpha=1 << 26).add_(fuel & self._middle(height, width, fuel.device), alpha=1 << 25)
        cell = torch.arange(height * width, device=fuel.device)
        score = score.flatten(1).mul_(height * width).add_(cell)  # no two alike: topk breaks ties as it likes
        best = _largest(score, self.count)
        centres = torch.zeros(worlds, height * width, dtype=torch.bool, device=fuel.device)
        centres.scatter_(1, best % (height * width), best >= (height * width) << 26)
        return grow(centres.view_as(fuel), self.radius) & fuel

    def _middle(self, height: int, width: int, device: torch.device) -> Tensor:
        rows = (torch.arange(height, device=device) + 0.5) / height - 0.5
        columns = (torch.arange(width, device=device) + 0.5) / width - 0.5
        half = self.region / 2.0
        return (rows.abs() <= half)[:, None] & (columns.abs() <= half)[None, :]


def _largest(scores: Tensor, count: int) -> Tensor:
    """Return the ``count`` largest numbers of each row, int64 [B, count], of distinct numbers, int64 [B, n]."""
    if count > _FEW:
        return scores.topk(count, dim=1).values
    found = [scores.amax(dim=1, keepdim=True)]
    while len(found) < count:
        found.append(torch.where(scores < found[-1], scores, -1).amax(dim=1, keepdim=True))
    return torch.cat(found, dim=1)
