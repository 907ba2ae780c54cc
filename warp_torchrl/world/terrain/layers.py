"""Layers of a map on one grid: found in a folder, read or resampled, with units."""

import logging
from collections.abc import Iterable, Mapping
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from warp_torchrl.system import memory
from warp_torchrl.world.terrain.bands import DENSITIES, LENGTHS, factor_of
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import RASTERS, Header, find_layer, read_header, read_layer
from warp_torchrl.world.terrain.planes import read_worth, to_bulk_density, to_canopy_cover, to_canopy_height
from warp_torchrl.world.terrain.resampling import regrid, resample_layer
from warp_torchrl.world.terrain.vector import SUFFIXES

_log = logging.getLogger("warp_torchrl")
_HEIGHT = ("height", LENGTHS, "0.1 for LANDFIRE or 1 for metres")
_DENSITY = ("density", DENSITIES, "0.01 for LANDFIRE or 1 for kg/m3")
"""What a layer of a canopy measures, units that a file may state, and how users say theirs."""
_BYTES = 30  # of a cell of a layer while it is read


class Layers(NamedTuple):
    """Layers by name, all on one grid."""

    grid: Grid
    values: dict[str, np.ndarray]  # [H, W]
    known: dict[str, np.ndarray]  # bool [H, W]
    headers: dict[str, Header]  # of the rasters
    paths: Mapping[str, Path]


def find_layers(path: str | PathLike[str] | None, patterns: Mapping[str, str | None]) -> dict[str, Path]:
    """Return the file of each layer that has a pattern.

    Args:
        path: A folder; or the fuel layer's file, with the others beside it.
        patterns: File name or pattern by the layer's name, ``fuel`` first; None leaves a layer out.

    Raises:
        ValueError: If the path does not exist, or a pattern names no file, or several.
    """
    try:
        exists = isinstance(path, str | PathLike) and path and Path(path).exists()
    except OSError:  # a name too long
        exists = False
    if path is None or not exists:
        raise ValueError(f"path must name a folder of rasters, or a raster, that exists, got {path!r}")
    place = Path(path)
    folder = place if place.is_dir() else place.parent
    named = {name: pattern for name, pattern in patterns.items() if pattern is not None}
    alone = {} if place.is_dir() else {"fuel": place}
    return {name: alone.get(name) or find_layer(name, folder, pattern) for name, pattern in named.items()}


def read_layers(
    paths: Mapping[str, Path],
    bands: Mapping[str, int | str],
    resample: Literal["refuse", "nearest", "mode"],
    resolution: float | None,
) -> Layers:
    """Return the values of each layer on the grid of ``fuel``, or one over it; every header is checked first.

    Args:
        paths: The file of each layer.
        bands: Number or description of the bands that are chosen, by layer.
        resample: What becomes of layers on another grid, see ``Raster``.
        resolution: Side of the grid's cells [m]; None keeps that of ``fuel``.

    Raises:
        ValueError: If a file cannot be read, is enormous, or does not fit.
    """
    strict = resample == "refuse"
    if unknown := [name for name in bands if name not in paths]:
        raise ValueError(f"bands must choose bands of {', '.join(paths)}, got {unknown[0]}")
    rasters = {name: path for name, path in paths.items() if path.suffix.lower() not in SUFFIXES}
    remedy, headers = "resolution=30 resample=mode", {}
    for name, path in rasters.items():
        metric = resolution is None if name == "fuel" else strict
        key = f"give bands={{{name}: NUMBER}}"
        headers[name] = read_header(name, path, metric, remedy if name == "fuel" else "resample", bands.get(name), key)
    grid = headers["fuel"].grid
    if not grid.crs:
        _tell_once(f"{paths['fuel']} has no CRS: its cells are taken as squares of {grid.cell_size:g} m")
    if resolution is not None:
        grid = regrid("fuel", grid, resolution)
    _check_memory(grid, len(paths))
    for name in headers.keys() - {"fuel"} if strict else ():
        check_grid(name, headers[name].grid, "fuel", grid)
    made = Layers(grid, {}, {}, headers, paths)
    for name, path in paths.items():
        if name not in headers:
            made.values[name], made.known[name] = read_worth(path, grid), np.ones(grid.shape, bool)
            continue
        made.values[name], made.known[name] = _values(name, headers[name], grid, resample)
    return made


def _check_memory(grid: Grid, layers: int) -> None:
    """Refuse layers that do not fit in memory before they are read."""
    rows, columns = grid.shape
    wanted, there = rows * columns * layers * _BYTES, memory.available()
    if wanted > there:
        raise memory.too_little(f"{layers} layers of {rows} x {columns} cells", wanted, there)


def _values(name: str, header: Header, grid: Grid, resample: str) -> tuple[np.ndarray, np.ndarray]:
    if header.grid.differs_in(grid) is None:
        return read_layer(name, header.path, header.number)
    method: Any = resample if name == "fuel" else "bilinear"  # "refuse" has raised by now
    return resample_layer(name, header.path, grid, method, header.number)


def elevation_unit(header: Header, given: float | None) -> float:
    """Return the metres in the unit of an elevation layer: stated by the file, or given by the user; else 1.

    Raises:
        ValueError: If neither does where the map itself is in feet, or both do and differ.
    """
    crs = header.grid.crs
    if given is None and not header.unit and crs and crs.is_projected and crs.linear_units_factor[1] != 1.0:
        ways = "give elevation_unit (0.3048 for feet, 1 for metres) or state it in the file, gdal_edit -units ft"
        rule = f"state its unit where the map is in {crs.linear_units_factor[0]}"
        raise ValueError(f"elevation must {rule}, {header.path} does not: {ways}")
    return factor_of("elevation", header.path, header.unit, LENGTHS, given)


def canopy_unit(name: str, header: Header, given: float | None) -> float:
    """Return the metres in the unit of a layer of canopy heights, or the kg/m3 in that of its bulk density.

    Raises:
        ValueError: If neither user nor file states it, or both do and differ.
    """
    quantity, units, ways = _DENSITY if name.endswith("density") else _HEIGHT
    if given is None and not header.unit:
        rule = f"given with {name}, {ways}"
        raise ValueError(f"{quantity}_unit must be {rule}: {header.path} does not state it, got null")
    return factor_of(quantity, header.path, header.unit, units, given)


def unread_files(folder: Path, read: Iterable[Path]) -> list[str]:
    """Return the names of a folder's rasters and vector files that are not read."""
    there = {each.resolve() for each in read}
    kinds = (*RASTERS, *SUFFIXES)
    found = sorted(each for each in folder.iterdir() if each.suffix.lower() in kinds and each.is_file())
    return [each.name for each in found if each.resolve() not in there]


class CanopyUnits(NamedTuple):
    """Units of layers of a canopy, as the user gives them."""

    height: float | None = None  # metres
    density: float | None = None  # kg/m3


AS_STATED = CanopyUnits()
"""Units where files state them."""


def canopy_plane(
    name: str, values: np.ndarray, known: np.ndarray, header: Header, units: CanopyUnits
) -> tuple[np.ndarray, str]:
    """Return a layer of the canopy, float32 [H, W] in %, m or kg/m3, 0 where it is not known; and the unit of its file.

    Raises:
        ValueError: If its unit is not known, or a value lies out of its range.
    """
    if name.endswith("cover"):
        return to_canopy_cover(values, known), "%"
    if name.endswith("density"):
        unit = canopy_unit(name, header, units.density)
        return to_bulk_density(name, values, known, unit), f"{unit:g} kg/m3"
    unit = canopy_unit(name, header, units.height)
    return to_canopy_height(name, values, known, unit), "m" if unit == 1.0 else f"{unit:g} m"


@cache
def _tell_once(line: str) -> None:
    _log.warning(line)
