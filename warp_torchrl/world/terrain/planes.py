"""Planes of a landscape from the values of raster layers: metres, ages, canopies, worth, and unknown cells."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.world.state.state import OLDEST, Cover
from warp_torchrl.world.terrain.crop import DRAWN
from warp_torchrl.world.terrain.fuel import NO_FUEL_CODE
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.landscape import DENSEST, TALLEST
from warp_torchrl.world.terrain.vector import burn_in, read_shapes

LOWEST, HIGHEST = -1000.0, 10_000.0
"""Elevation that is believed [m]."""
_ENOUGH = 16  # rows and columns of a map whose slopes are judged


def to_metres(heights: np.ndarray, known: np.ndarray, unit: float = 1.0) -> np.ndarray:
    """Return elevation, float32 [H, W] [m], of heights in a unit [m]; 0 where it is not known.

    Raises:
        ValueError: If a height is not in [-1000, 10000] m: NaN, or nodata undeclared, -9999 or 32767.
    """
    words = " m" if unit == 1.0 else f" (-1000 to 10000 m in units of {unit:g} m)"
    _check("elevation", heights, known, LOWEST / unit, HIGHEST / unit, words)
    return np.where(known, heights * unit if unit != 1.0 else heights, 0).astype(np.float32)


def check_slopes(metres: np.ndarray, known: np.ndarray, cell_size: float) -> None:
    """Refuse elevation that is too steep to be in metres: half of the ground steeper than 45 degrees.

    Args:
        metres: Elevation, [H, W] [m].
        known: Where it is known, bool.
        cell_size: Side of a cell [m].

    Raises:
        ValueError: With the median slope.
    """
    if min(metres.shape) < _ENOUGH:
        return
    south, east = np.gradient(np.where(known, metres, np.nan), cell_size)
    steep = np.hypot(south, east)
    steep = steep[~np.isnan(steep)]
    if len(steep) and (median := float(np.median(steep))) > 1.0:
        got = f"half of its slopes are above {math.degrees(math.atan(median)):.0f} degrees"
        ways = "give elevation_unit (0.3048 for feet, 1 for metres) or state it in the file, gdal_edit -units ft"
        raise ValueError(f"elevation must be in metres where it states no unit, {got}: {ways}")


def to_worth(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the worth of each cell, float32 [H, W]; 0 where it is not known.

    Raises:
        ValueError: If a value is not finite, or below 0.
    """
    broken = known & ~((values >= 0.0) & (values <= np.finfo(np.float32).max))
    if broken.any():
        raise ValueError(f"assets must be finite and 0 or more wherever they are known, got {values[broken][0]}")
    return np.where(known, values, 0).astype(np.float32)


def read_worth(path: Path, grid: Grid) -> np.ndarray:
    """Return the worth of each cell of a grid from the shapes of a vector file, float64 [rows, columns].

    Raises:
        ValueError: If the file cannot be read or placed, or a property is not a number of 0 or more.
    """
    shapes = read_shapes("assets", path, grid)
    return burn_in(shapes, [_worth(path, shape.properties) for shape in shapes], grid)


def _worth(path: Path, properties: Mapping[str, Any]) -> float:
    told = {str(name).lower(): value for name, value in properties.items()}
    value = next((told[name] for name in ("worth", "value") if told.get(name) is not None), 1.0)
    try:
        worth = float(value)
    except (TypeError, ValueError, OverflowError):
        worth = math.nan
    if not 0.0 <= worth < math.inf:
        raise ValueError(f"assets must have a worth of 0 or more, {path} has {value!r}")
    return worth


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
    seen = values[known]
    if seen.size and seen.max() <= 1.0 and (seen != np.rint(seen)).any():
        raise ValueError(f"canopy must be in per cent, 0 to 100, it has shares of 1 at most, {seen.max():g}")
    return np.where(known, values, 0).astype(np.float32)


def to_canopy_height(name: str, values: np.ndarray, known: np.ndarray, unit: float) -> np.ndarray:
    """Return a height of the canopy, float32 [H, W] [m], of values in a unit [m]; 0 where it is not known.

    Raises:
        ValueError: If a height is not in 0 to 150 m.
    """
    _check(name, values, known, 0.0, TALLEST / unit, f" ({TALLEST:g} m in units of {unit:g} m)")
    return (np.where(known, values, 0) * unit).astype(np.float32)


def to_bulk_density(name: str, values: np.ndarray, known: np.ndarray, unit: float) -> np.ndarray:
    """Return the canopy's bulk density, float32 [H, W] [kg/m3], of values in a unit [kg/m3]; 0 where it is not known.

    Raises:
        ValueError: If a density is not in 0 to 2 kg/m3.
    """
    _check(name, values, known, 0.0, DENSEST / unit, f" ({DENSEST:g} kg/m3 in units of {unit:g} kg/m3)")
    return (np.where(known, values, 0) * unit).astype(np.float32)


def to_fuel(codes: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return class codes, int16 [H, W]; ``NO_FUEL_CODE`` where they are not known.

    Raises:
        ValueError: If a code is not whole, or not in -32768..32767.
    """
    broken = known & (codes != np.rint(codes))
    if broken.any():
        raise ValueError(f"fuel must hold whole class codes, got {codes[broken][0]}")
    _check("fuel", codes, known, -32768, 32767)
    return np.where(known, codes, NO_FUEL_CODE).astype(np.int16)


def _check(name: str, values: np.ndarray, known: np.ndarray, low: float, high: float, unit: str = "") -> None:
    broken = known & ~((values >= low) & (values <= high))
    if broken.any():
        raise ValueError(
            f"{name} must be in [{low:.6g}, {high:.6g}]{unit} wherever it is known, got {values[broken][0]}"
        )
