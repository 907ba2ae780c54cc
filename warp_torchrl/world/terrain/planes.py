"""What the values of raster layers are to the world: metres, ages, canopies, worth, and where there are none."""

import numpy as np

from warp_torchrl.world.state import OLDEST, Cover
from warp_torchrl.world.terrain.crop import DRAWN
from warp_torchrl.world.terrain.fuel import NO_FUEL
from warp_torchrl.world.terrain.landscape import TALLEST


def to_metres(heights: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return elevation, float32 [H, W] [m]; 0 where it is not known.

    Raises:
        ValueError: If a height is not in [-1000, 10000] m: NaN, or nodata undeclared, -9999 or 32767.
    """
    _check("elevation", heights, known, -1000.0, 10_000.0, " m")
    return np.where(known, heights, 0).astype(np.float32)


def to_worth(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return what each cell is worth, float32 [H, W]; 0 where it is not known.

    Raises:
        ValueError: If a value is not finite, or below 0.
    """
    broken = known & ~((values >= 0.0) & (values <= np.finfo(np.float32).max))
    if broken.any():
        raise ValueError(f"assets must be finite and 0 or more wherever they are known, got {values[broken][0]}")
    return np.where(known, values, 0).astype(np.float32)


def to_age(name: str, values: np.ndarray, known: np.ndarray, top: float) -> np.ndarray:
    """Return the tree's code, uint8 [H, W], 10 from ``top`` on and halves up; ``DRAWN`` where it is not known.

    Raises:
        ValueError: If an age is not in [0, 10000], or canopy cover not in [0, 100]: nodata undeclared, 255 or 32767.
    """
    _check(name, values, known, 0.0, 100.0 if name == "canopy" else 10_000.0)
    code = np.floor(OLDEST * np.where(known, values, 0).astype(np.float64) / top + 0.5).clip(max=OLDEST)
    return np.where(known, code, DRAWN).astype(np.uint8)


def to_forest_age(cover: np.ndarray, values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the code of forest trees by canopy cover [%], uint8 [H, W], 1 at least; ``DRAWN`` elsewhere."""
    age = to_age("canopy", values, known, 100.0)
    return np.where((cover == int(Cover.FOREST)) & (age != DRAWN), np.maximum(age, 1), np.uint8(DRAWN))


def to_canopy_cover(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return canopy cover, float32 [H, W] [%]; 0 where it is not known.

    Raises:
        ValueError: If it is not in [0, 100].
    """
    _check("canopy", values, known, 0.0, 100.0)
    return np.where(known, values, 0).astype(np.float32)


def to_canopy_height(values: np.ndarray, known: np.ndarray, unit: float) -> np.ndarray:
    """Return the height of the canopy's top, float32 [H, W] [m], of values in a unit [m]; 0 where it is not known.

    Raises:
        ValueError: If a height is not in 0 to 150 m.
    """
    _check("canopy_height", values, known, 0.0, TALLEST / unit, f" (150 m in units of {unit:g} m)")
    return (np.where(known, values, 0) * unit).astype(np.float32)


def to_fuel(codes: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return whole class codes, int16 [H, W]; ``NO_FUEL`` where they are not known.

    Raises:
        ValueError: If a code is not in -32768..32767.
    """
    _check("fuel", codes, known, -32768, 32767)
    return np.where(known, codes, NO_FUEL).astype(np.int16)


def _check(name: str, values: np.ndarray, known: np.ndarray, low: float, high: float, unit: str = "") -> None:
    broken = known & ~((values >= low) & (values <= high))
    if broken.any():
        raise ValueError(
            f"{name} must be in [{low:.6g}, {high:.6g}]{unit} wherever it is known, got {values[broken][0]}"
        )
