"""The landscape from Perlin noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.bytes import byte
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.state.state import OLDEST, Cover, Landscape
from warp_torchrl.world.terrain.perlin import fractal_noise
from warp_torchrl.world.terrain.source import map_size

TALLEST = 150.0
"""Height of a canopy that is believed [m]; the tallest tree known has 116."""
DENSEST = 2.0
"""Bulk density of a canopy that is believed [kg/m3]; LANDFIRE has 0.45 at most."""


def draw_age(key: Tensor, cover: Tensor) -> Tensor:
    """Draw the initial forest, age = round(10 U(0,1)) where a tree can stand (WARP-CA, initial state).

    Args:
        key: World keys, int64 [B].
        cover: Land cover, uint8 [B, H, W].

    Returns:
        uint8 [B, H, W] in 0..10; lakes and bare cells 0.
    """
    age = uniform(key, 0, Stream.AGE, tuple(cover.shape[1:])).mul_(OLDEST).round_().to(torch.int32).to(torch.uint8)
    return age.mul_(byte(holds_trees(cover)))


_PRINTED = (0.01, 0.2, 0.01)
_RANGES = ("scale", "octaves", "persistence", "lacunarity", "relief")


_Number = TypeVar("_Number", int, float)


def _ends(value: _Number | tuple[_Number, _Number]) -> tuple[_Number, _Number]:
    """Return the lowest and the highest value of a number or a pair."""
    low, high = value if isinstance(value, Sequence) else (value, value)
    return low, high


def _powers(base: Tensor, count: int) -> Tensor:
    """Return base^0, base^1, ... [B, count] of a base [B, 1].

    As a product: torch's ``pow`` gives other last bits in other batches, and a world must not.
    """
    return torch.cat((torch.ones_like(base), base.expand(-1, count - 1)), dim=1).cumprod(dim=1)


@dataclass(frozen=True, kw_only=True)
class Perlin:
    """Terrain from fractal gradient noise (WARP-CA, terrain and table of hyperparameters).

    The noise n is scaled to [0, 1] on each map; low ground is water, high ground forest:
    lake n < L, wetland L <= n < W, grassland W <= n < G, forest n >= G.

    ``scale``, ``octaves``, ``persistence``, ``lacunarity`` and ``relief`` take a number, or a pair from low to high
    between which each episode draws a value, uniformly (the paper's conclusion regrets that they are fixed).

    Attributes:
        size: Side of the map, or (rows, columns) [cells].
        scale: sigma, cells per lattice step of the first octave.
        octaves: Terms of the sum.
        persistence: Amplitude of each octave relative to the one before.
        lacunarity: lambda, ratio of the octaves' frequencies.
        frequency_law: ``text`` x lambda^i / sigma, finer with i as the paper's text says; ``printed``
            x / (sigma lambda^i), coarser with i as its equation has it.
        thresholds: ``quantile`` takes ``levels`` as cumulative shares of the map, so that every map has the same
            mixture; ``minmax`` as values of n; ``printed`` takes (0.01, 0.2, 0.01) as values of n, out of order as
            the paper prints them, which leaves no grassland.
        levels: (L, W, G); not read by ``printed``.
        relief: Height of n = 1 over n = 0 [m]; 0 makes a flat world.
        independent_elevation: Draw the elevation from another noise than that of the cover.
        ages: ``drawn`` draws the trees' ages, as the paper does; ``oldest`` gives all the oldest, 10.

    Raises:
        ValueError: If a value is out of its range or the levels are out of order (``printed`` excepted).
    """

    size: tuple[int, int] | int = 32
    scale: float | tuple[float, float] = 15.0
    octaves: int | tuple[int, int] = 6
    persistence: float | tuple[float, float] = 0.5
    lacunarity: float | tuple[float, float] = 2.0
    frequency_law: Literal["text", "printed"] = "text"
    thresholds: Literal["quantile", "minmax", "printed"] = "quantile"
    levels: tuple[float, float, float] = (0.06, 0.16, 0.36)
    relief: float | tuple[float, float] = 0.0
    independent_elevation: bool = False
    ages: Literal["drawn", "oldest"] = "drawn"

    def __post_init__(self) -> None:
        check_fields(
            self,
            scale=(1.0, 1e4),
            octaves=(1, 12),
            persistence=(0.0, 1.0),
            lacunarity=(1.0, 8.0),
            relief=(0.0, 10_000.0),
        )
        map_size(self.size)
        if max(self._finest()) > 32.0:
            raise ValueError(
                f"lacunarity ** (octaves - 1) / scale must be at most 32 lattice steps a cell, "
                f"got {max(self._finest()):g}"
            )
        levels = tuple(self.levels)
        if len(levels) != 3 or not all(0.0 <= level <= 1.0 for level in levels):
            raise ValueError(f"levels must be three numbers in [0, 1], got {list(levels)}")
        if self.thresholds != "printed" and not levels[0] <= levels[1] <= levels[2]:
            raise ValueError(f"levels must be in order, lake <= wetland <= grassland, got {list(levels)}")

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world, batch size [B]."""
        noise = self.noise(key)
        cover = self._cover(noise)
        elevation = None
        if not self.is_flat:
            ground = self.noise(key, Stream.ELEVATION) if self.independent_elevation else noise
            elevation = self._draw(key, "relief").to(torch.float32)[:, None, None] * ground
        age = draw_age(key, cover) if self.ages == "drawn" else holds_trees(cover).to(torch.uint8) * OLDEST
        return Landscape(cover=cover, age=age, elevation=elevation)

    @property
    def is_flat(self) -> bool:
        """Return whether all ground is flat."""
        return _ends(self.relief)[1] == 0.0

    def noise(self, key: Tensor, stream: Stream = Stream.NOISE) -> Tensor:
        """Return the noise scaled to [0, 1] on each map, float32 [B, H, W]."""
        count = _ends(self.octaves)[1]
        scale, lacunarity, persistence, octaves = (
            self._draw(key, name)[:, None] for name in ("scale", "lacunarity", "persistence", "octaves")
        )
        steps = _powers(lacunarity, count)
        frequency = steps / scale if self.frequency_law == "text" else 1.0 / (scale * steps)
        amplitude = _powers(persistence, count) * (torch.arange(count, device=key.device) < octaves)
        frequencies, amplitudes = frequency.to(torch.float32), amplitude.to(torch.float32)
        noise = fractal_noise(key, map_size(self.size), frequencies, amplitudes, stream, self._finest())
        low, high = noise.amin((1, 2), keepdim=True), noise.amax((1, 2), keepdim=True)
        return (noise - low) / (high - low).clamp_(min=1e-12)

    def _draw(self, key: Tensor, name: str) -> Tensor:
        """Return each world's value of a parameter, float64 [B], or [1] where it is fixed."""
        low, high = _ends(getattr(self, name))
        if low == high:
            return torch.full((1,), low, dtype=torch.float64, device=key.device)
        draw = uniform(key, _RANGES.index(name), Stream.TERRAIN, (1,))[:, 0].double()
        if name == "octaves":
            return low + (draw * (high - low + 1)).floor()
        return low + draw * (high - low)

    def _finest(self) -> list[float]:
        """Return the highest frequency that each octave can have [1 / cell]."""
        scale, octaves, (low, high) = _ends(self.scale)[0], range(_ends(self.octaves)[1]), _ends(self.lacunarity)
        if self.frequency_law == "text":
            return [high**octave / scale for octave in octaves]
        return [1.0 / (scale * low**octave) for octave in octaves]

    def _cover(self, noise: Tensor) -> Tensor:
        lake, wetland, grassland = self._levels_of(noise)
        if self.thresholds != "printed":  # in order, so that the code is the number of levels below
            reached = torch.empty_like(noise)
            above = torch.ge(noise, lake, out=torch.empty_like(noise))
            for higher in (wetland, grassland):
                above += torch.ge(noise, higher, out=reached)
            return above.to(torch.int32).to(torch.uint8)  # at once it takes twice the time
        cover = torch.full_like(noise, Cover.FOREST, dtype=torch.uint8)
        for code, level in ((Cover.GRASSLAND, grassland), (Cover.WETLAND, wetland), (Cover.LAKE, lake)):
            cover.masked_fill_(noise < level, code)
        return cover

    def _levels_of(self, noise: Tensor) -> Sequence[Tensor | float]:
        """Return L, W and G as values of the noise."""
        if self.thresholds != "quantile":
            return _PRINTED if self.thresholds == "printed" else self.levels
        cells = noise[0].numel()
        ranks = [min(cells - 1, math.floor(level * cells + 0.5)) for level in self.levels]
        ordered = _in_order_at(noise.flatten(1), ranks)
        return [ordered[:, rank, None, None] for rank in ranks]


def _in_order_at(values: Tensor, ranks: list[int]) -> Tensor:
    """Return rows of numbers, float32 [B, n], sorted only as far as these ranks hold a sort's values."""
    if not needs_no_sync(values.device):
        return values.sort(dim=1).values
    return torch.from_numpy(np.partition(values.numpy(), ranks, axis=1))  # a quarter of the time of torch's sort
