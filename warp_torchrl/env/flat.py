"""Conversion between an agent's observation and one vector, for learners that read one array."""

from collections.abc import Mapping

import numpy as np

FLAT = "observation"
"""Key of the vector beside ``action_mask``, as in PettingZoo's tutorials and Tianshou."""
Shapes = Mapping[str, tuple[tuple[int, ...], str]]
"""Shape and dtype of one agent's entries, by name."""


def flattened(entries: Mapping[str, np.ndarray], n_batch: int = 0) -> np.ndarray:
    """Concatenate entries in alphabetical order of their names, float32 [..., n]; uint8 is divided by 255.

    Args:
        entries: By name, [..., shape] each.
        n_batch: How many dimensions come before those of an agent's entry.
    """
    parts = [_scaled(entries[name]) for name in sorted(entries)]
    return np.concatenate([part.reshape(*part.shape[:n_batch], -1) for part in parts], axis=-1)


def unflattened(vector: np.ndarray, shapes: Shapes, what: str = FLAT) -> dict[str, np.ndarray]:
    """Invert ``flattened`` exactly: return the entries of a vector [..., n].

    Args:
        vector: float32.
        shapes: Of the entries.
        what: Its name in messages.

    Raises:
        ValueError: If the vector is not float32 or of another length.
    """
    sizes = {name: int(np.prod(shapes[name][0])) for name in sorted(shapes)}
    length = sum(sizes.values())
    if vector.dtype != np.float32 or vector.shape[-1:] != (length,):
        raise ValueError(f"{what} must be float32 of shape [..., {length}], got {vector.dtype} {[*vector.shape]}")
    parts = np.split(vector, np.cumsum(list(sizes.values()))[:-1], axis=-1)
    return {name: _unscaled(part, *shapes[name]) for name, part in zip(sizes, parts)}


def _scaled(value: np.ndarray) -> np.ndarray:
    return value.astype(np.float32) / np.float32(255.0) if value.dtype == np.uint8 else value


def _unscaled(part: np.ndarray, shape: tuple[int, ...], dtype: str) -> np.ndarray:
    value = part.reshape(*part.shape[:-1], *shape)
    return np.rint(value * np.float32(255.0)).astype(np.uint8) if dtype == "uint8" else value
