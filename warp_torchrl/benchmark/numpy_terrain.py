"""New ground for the NumPy world: terrain, forest and fires as in ``conf/scenario/large.yaml``, in NumPy alone."""

from dataclasses import asdict
from typing import Any

import numpy as np

from warp_torchrl.world.state.state import OLDEST, Cover
from warp_torchrl.world.terrain.landscape import Perlin

_PERLIN: dict[str, Any] = asdict(Perlin())


def new_ground(rng: np.random.Generator, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Draw a landscape and its forest.

    Args:
        rng: Draws.
        size: (H, W) [cells].

    Returns:
        Cover uint8 [H, W] and tree age uint8 [H, W], 0 on lakes.
    """
    noise = sum(
        _PERLIN["persistence"] ** octave * _noise(rng, size, _PERLIN["lacunarity"] ** octave / _PERLIN["scale"])
        for octave in range(_PERLIN["octaves"])
    )
    levels = np.sort(noise, axis=None)[[int(level * noise.size + 0.5) for level in _PERLIN["levels"]]]
    cover = np.digitize(noise, levels).astype(np.uint8)
    age = np.rint(rng.random(size, dtype=np.float32) * OLDEST).astype(np.uint8)
    return cover, age * (cover != Cover.LAKE)


def light(rng: np.random.Generator, fuel: np.ndarray, n_fires: int) -> np.ndarray:
    """Return the cells to light, bool [H, W]: 3 x 3 patches of fuel round cells of the middle.

    A map with too few trees there is lit elsewhere.

    Args:
        rng: Draws.
        fuel: Trees that can ignite, bool [H, W].
        n_fires: Patches.
    """
    height, width = fuel.shape
    middle = np.zeros_like(fuel)
    middle[height // 5 : height - height // 5, width // 5 : width - width // 5] = True
    places = np.flatnonzero(fuel & middle)
    places = places if len(places) >= n_fires else np.flatnonzero(fuel)
    rows, columns = np.unravel_index(rng.choice(places, min(n_fires, len(places)), replace=False), fuel.shape)
    lit = np.zeros((height + 2, width + 2), dtype=bool)
    for row, column in zip(rows, columns, strict=True):
        lit[row : row + 3, column : column + 3] = True
    return lit[1:-1, 1:-1] & fuel


def start_cells(rng: np.random.Generator, taken: np.ndarray, n_agents: int) -> np.ndarray:
    """Return the free cells nearest to a corner that is drawn, int64 [A, 2].

    Args:
        rng: Draws.
        taken: Where nobody can stand, bool [H, W].
        n_agents: A.
    """
    height, width = taken.shape
    row, column = rng.integers(2, size=2) * (height - 1, width - 1)
    down, across = np.abs(np.arange(height) - row)[:, None], np.abs(np.arange(width) - column)
    order = np.maximum(down, across) * (height + width) + down + across + taken * (height + width) ** 2
    return np.stack(np.unravel_index(np.argsort(order, axis=None, kind="stable")[:n_agents], taken.shape), axis=1)


def _noise(rng: np.random.Generator, size: tuple[int, int], frequency: float) -> np.ndarray:
    """Return one octave of gradient noise, float32 [H, W]: two matrix products, for it is linear in the gradients."""
    (row_blend, row_lever), (column_blend, column_lever) = (_weights(rng, length, frequency) for length in size)
    angle = rng.random((row_blend.shape[1], column_blend.shape[1]), dtype=np.float32) * np.float32(2.0 * np.pi)
    return row_lever @ np.sin(angle) @ column_blend.T + row_blend @ np.cos(angle) @ column_lever.T


def _weights(rng: np.random.Generator, length: int, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of each lattice line in each cell, and that times its distance to the line, [length, L] each."""
    place = np.arange(length, dtype=np.float32) * np.float32(frequency) + rng.random(dtype=np.float32)
    lattice = place.astype(np.int64)
    part = place - lattice
    fade = part * part * part * (part * (part * 6.0 - 15.0) + 10.0)
    cell = np.arange(length)
    blend, lever = np.zeros((2, length, lattice[-1] + 2), dtype=np.float32)
    blend[cell, lattice], blend[cell, lattice + 1] = 1.0 - fade, fade
    lever[cell, lattice], lever[cell, lattice + 1] = (1.0 - fade) * part, fade * (part - 1.0)
    return blend, lever
