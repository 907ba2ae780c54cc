"""Landscape sources: Perlin noise, and arrays that a user passes.

A source has a ``size`` (H, W) and, called with world keys, returns the ``Landscape`` of each world's episode.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.world.perlin import fractal_noise
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import OLDEST, Cover, Landscape
from warp_torchrl.world.validation import check_fields

LARGEST_SIDE = 4096
"""Longest side of a simulated map [cells]."""


@runtime_checkable
class LandscapeSource(Protocol):
    """What the world needs of a landscape component."""

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
    sides = (size, size) if type(size) is int else size
    fits = isinstance(sides, Sequence) and not isinstance(sides, str) and len(sides) == 2
    if not fits or not all(type(side) is int and 4 <= side <= LARGEST_SIDE for side in sides):
        raise ValueError(f"size must be one side or [rows, columns], each in 4..{LARGEST_SIDE} cells, got {size}")
    return tuple(sides)


def draw_age(key: Tensor, cover: Tensor) -> Tensor:
    """Draw the initial forest, age = round(10 U(0,1)) where a tree can stand (WARP-CA, initial state).

    Args:
        key: World keys, int64 [B].
        cover: Land cover, uint8 [B, H, W].

    Returns:
        uint8 [B, H, W] in 0..10; lakes and bare cells 0.
    """
    age = uniform(key, 0, Stream.AGE, tuple(cover.shape[1:])).mul_(OLDEST).round_().to(torch.uint8)
    return age * holds_trees(cover)


def holds_trees(cover: Tensor) -> Tensor:
    """Return where a tree can stand (wetland, grassland, forest), bool, shape of the input."""
    return (cover != Cover.LAKE) & (cover != Cover.BARE)


_PRINTED = (0.01, 0.2, 0.01)


@dataclass(frozen=True, kw_only=True)
class Perlin:
    """Terrain from fractal gradient noise (WARP-CA, terrain and table of hyperparameters).

    The noise n is scaled to [0, 1] on each map; low ground is water, high ground forest:
    lake n < L, wetland L <= n < W, grassland W <= n < G, forest n >= G.

    Attributes:
        size: Side of the map, or (rows, columns) [cells].
        scale: sigma, cells to a lattice step of the first octave.
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
        independent_elevation: Draw the elevation from a noise of its own, not the one that made the cover.

    Raises:
        ValueError: If a value is out of its range or the levels are out of order (``printed`` excepted).
    """

    size: tuple[int, int] | int = 32
    scale: float = 15.0
    octaves: int = 6
    persistence: float = 0.5
    lacunarity: float = 2.0
    frequency_law: Literal["text", "printed"] = "text"
    thresholds: Literal["quantile", "minmax", "printed"] = "quantile"
    levels: tuple[float, float, float] = (0.06, 0.16, 0.36)
    relief: float = 0.0
    independent_elevation: bool = False

    def __post_init__(self) -> None:
        map_size(self.size)
        check_fields(
            self,
            scale=(1.0, 1e4),
            octaves=(1, 12),
            persistence=(0.0, 1.0),
            lacunarity=(1.0, 8.0),
            relief=(0.0, 10_000.0),
        )
        if self.frequency_law == "text" and max(self._frequencies()) > 32.0:
            raise ValueError(
                f"lacunarity ** (octaves - 1) / scale must be at most 32 lattice steps a cell, "
                f"got {max(self._frequencies()):g}"
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
        if self.relief > 0.0:
            ground = self.noise(key, Stream.ELEVATION) if self.independent_elevation else noise
            elevation = self.relief * ground
        return Landscape(cover=cover, age=draw_age(key, cover), elevation=elevation, batch_size=key.shape)

    def noise(self, key: Tensor, stream: Stream = Stream.NOISE) -> Tensor:
        """Return the noise scaled to [0, 1] on each map, float32 [B, H, W]."""
        amplitudes = [self.persistence**octave for octave in range(self.octaves)]
        noise = fractal_noise(key, map_size(self.size), self._frequencies(), amplitudes, stream)
        low, high = noise.amin((1, 2), keepdim=True), noise.amax((1, 2), keepdim=True)
        return (noise - low) / (high - low).clamp_(min=1e-12)

    def _frequencies(self) -> list[float]:
        sign = 1.0 if self.frequency_law == "text" else -1.0
        return [self.lacunarity ** (sign * octave) / self.scale for octave in range(self.octaves)]

    def _cover(self, noise: Tensor) -> Tensor:
        if self.thresholds == "quantile":
            ordered = noise.flatten(1).sort(dim=1).values
            cells = ordered.shape[1]
            lake, wetland, grassland = (
                ordered[:, min(cells - 1, math.floor(level * cells + 0.5)), None, None] for level in self.levels
            )
        else:
            lake, wetland, grassland = _PRINTED if self.thresholds == "printed" else self.levels
        cover = torch.full_like(noise, Cover.FOREST, dtype=torch.uint8)
        for code, level in ((Cover.GRASSLAND, grassland), (Cover.WETLAND, wetland), (Cover.LAKE, lake)):
            cover.masked_fill_(noise < level, code)
        return cover


@dataclass(frozen=True, kw_only=True, eq=False)
class Array:
    """A landscape that the user has: cover, and optionally elevation and tree age.

    Attributes:
        path: An ``.npz`` file with ``cover`` [H, W] of codes 0..4, and optionally ``elevation`` [m] and ``age``
            0..10; or None where the arrays are passed.
        cover: Land cover codes [H, W], anything ``numpy.asarray`` takes.
        elevation: Elevation [H, W] [m]; None makes a flat world.
        age: Tree age [H, W]; None draws it for each episode.

    Raises:
        ValueError: If there is no cover, shapes differ, a code is not in 0..4, an age not in 0..10, or an elevation
            is not finite.
    """

    path: str | None = None
    cover: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False)
    elevation: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(default=None, repr=False)
    age: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        layers = _read_npz(self.path) if self.path is not None else {}
        for name in ("cover", "elevation", "age"):
            layer = layers.get(name, getattr(self, name))
            object.__setattr__(self, name, None if layer is None else np.asarray(layer))
        if self.cover is None:
            raise ValueError("cover must be given, as an array or in the file that path names")
        map_size(self.size)
        for name, low, high in (("cover", 0, max(Cover)), ("age", 0, OLDEST)):
            layer = getattr(self, name)
            if layer is not None and not ((layer >= low) & (layer <= high) & (layer == np.round(layer))).all():
                raise ValueError(f"{name} must hold whole numbers in {low}..{high}")
        if self.elevation is not None and not np.isfinite(self.elevation).all():
            raise ValueError("elevation must be finite everywhere")
        for name in ("elevation", "age"):
            layer = getattr(self, name)
            if layer is not None and layer.shape != self.cover.shape:
                raise ValueError(f"{name} must have the shape of cover {self.cover.shape}, got {layer.shape}")

    @property
    def size(self) -> tuple[int, int]:
        """Return (H, W) [cells]."""
        if self.cover.ndim != 2:
            raise ValueError(f"cover must have two dimensions, rows and columns, got shape {self.cover.shape}")
        return self.cover.shape

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world, the same ground for all, batch size [B]."""
        worlds, device = key.shape[0], key.device

        def layer(array: np.ndarray, dtype: torch.dtype) -> Tensor:
            return torch.as_tensor(array, device=device).to(dtype).expand(worlds, -1, -1).contiguous()

        cover = layer(self.cover, torch.uint8)
        age = draw_age(key, cover) if self.age is None else layer(self.age, torch.uint8) * holds_trees(cover)
        elevation = None if self.elevation is None else layer(self.elevation, torch.float32)
        return Landscape(cover=cover, age=age, elevation=elevation, batch_size=key.shape)


def _read_npz(path: str) -> dict[str, np.ndarray]:
    """Read the layers of an ``.npz`` file, without pickle."""
    if not Path(path).is_file():
        raise ValueError(f"path must name an .npz file, nothing at {path}")
    try:
        with np.load(path, allow_pickle=False) as layers:
            return {name: layers[name] for name in ("cover", "elevation", "age") if name in layers}
    except (OSError, ValueError, EOFError, KeyError, TypeError) as error:
        raise ValueError(f"path must name an .npz file of plain arrays, {path} is not one: {error}") from None
