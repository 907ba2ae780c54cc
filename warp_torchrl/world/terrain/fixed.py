"""One ground for every world, with all else drawn."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.source import LandscapeSource


@dataclass(frozen=True, kw_only=True)
class Fixed:
    """The landscape of another source for one seed, in every world.

    Cover, elevation, trees' ages and the window of a raster are those of the seed's first episode. Ignition, wind, fire
    and the team's place still follow each world's own key. What else the other source knows of its map, such as its
    grid or cell size, can be asked here too.

    Attributes:
        source: The other source.
        seed: World seed whose ground it is, in 0..2^62.

    Raises:
        ValueError: If the seed is out of its range.
    """

    source: LandscapeSource
    seed: int

    def __post_init__(self) -> None:
        check_fields(self, seed=(0, 2**62))

    def __call__(self, key: Tensor) -> Landscape:
        """Return the one landscape for each of the keys, int64 [B], batch size [B]."""
        ground = self.source(world_key(torch.full((1,), self.seed, device=key.device)))
        return ground[torch.zeros_like(key)]

    @property
    def size(self) -> tuple[int, int] | int:
        """Return the map's (H, W), or its side where it is square [cells]."""
        return self.source.size

    def __getattr__(self, name: str) -> Any:
        """Return the source's attributes beyond the protocol: grid, extent, reach, cell size."""
        if name == "source" or name.startswith("__"):  # asked for by copy and pickle before there is a source
            raise AttributeError(name)
        return getattr(self.source, name)
