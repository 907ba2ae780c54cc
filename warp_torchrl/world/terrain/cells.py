"""Cells of a grid that a file marks: points in a CSV, a raster, or the shapes of a vector file."""

import csv
import logging
from os import PathLike
from pathlib import Path

import numpy as np

from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import read_grid, read_layer
from warp_torchrl.world.terrain.vector import SUFFIXES, burn_in, in_grid, read_shapes

_RASTERS = (".tif", ".tiff", ".asc")
_COLUMNS = {
    ("row", "column"): "cells",
    ("x", "y"): "map",
    ("longitude", "latitude"): "EPSG:4326",
    ("lon", "lat"): "EPSG:4326",
}
"""Pairs of columns of a CSV, and what they count in."""
_log = logging.getLogger("warp_torchrl")


def read_cells(name: str, path: str | PathLike[str], grid: Grid) -> np.ndarray:
    """Return the cells of a grid that a file marks, bool [rows, columns]; one at least.

    A point marks the cell that it lies in, a line those that it touches, a polygon those whose middle it holds, and a
    raster those that are neither 0 nor nodata. What lies off the grid is left out, and counted in a warning.

    Args:
        name: What the file is, for messages.
        path: A CSV of ``row,column`` (from 0), ``x,y`` (in the grid's CRS) or ``longitude,latitude``; a raster (.tif,
            .asc) on the grid; GeoJSON or a shapefile (see ``read_shapes``).
        grid: The grid; its transform is None where the landscape has no place on Earth.

    Raises:
        ValueError: If the file is missing, damaged or of no such kind, or marks no cell.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in (".csv", *_RASTERS, *SUFFIXES) or not file.is_file():
        kinds = ", ".join((".csv", *_RASTERS, *SUFFIXES))
        raise ValueError(f"{name} must name a file that exists, one of {kinds}, got {path}")
    if suffix == ".csv":
        cells = _read_points(name, file, grid)
    elif suffix in SUFFIXES:
        shapes = read_shapes(name, file, grid)
        cells = burn_in(shapes, np.ones(len(shapes)), grid) > 0.0
    else:
        cells = _read_raster(name, file, grid)
    if not cells.any():
        raise ValueError(f"{name} must mark a cell of the map, {path} marks none")
    return cells


def _read_raster(name: str, path: Path, grid: Grid) -> np.ndarray:
    own = read_grid(name, path, metric=False)
    if own.crs is None or grid.crs is None:  # an ASCII grid has none: its place tells enough
        own = own._replace(crs=grid.crs)
    if grid.transform is None:
        own = own._replace(transform=None)
        if own.shape != grid.shape:
            raise ValueError(f"{name} must have the shape of the landscape, {grid.shape}, got {own.shape}")
    else:
        check_grid(name, own, "the landscape", grid)
    values, known = read_layer(name, path)
    return known & (values != 0)


def _read_points(name: str, path: Path, grid: Grid) -> np.ndarray:
    """Return the cells that the points of a CSV lie in."""
    first, second, unit = _read_pairs(name, path)
    if unit == "cells":
        row, column = first, second
        if not (np.rint(row) == row).all() or not (np.rint(column) == column).all():
            raise ValueError(f"{name} must have whole rows and columns, from 0, {path} has others")
    else:
        x, y = in_grid(name, first, second, None if unit == "map" else unit, grid)
        inverse = ~grid.transform
        column, row = (inverse[at] * x + inverse[at + 1] * y + inverse[at + 2] for at in (0, 3))
    inside = (row >= 0) & (row < grid.shape[0]) & (column >= 0) & (column < grid.shape[1])
    if not inside.any():
        place = f"{grid.shape[0]} x {grid.shape[1]} cells"
        raise ValueError(f"{name} must have points on the map of {place}, {path} has {len(row)}, none of them there")
    if not inside.all():
        _log.warning("%s: %d of %d points of %s lie off the map", name, (~inside).sum(), len(row), path)
    cells = np.zeros(grid.shape, bool)
    cells[row[inside].astype(int), column[inside].astype(int)] = True
    return cells


def _read_pairs(name: str, path: Path) -> tuple[np.ndarray, np.ndarray, str]:
    """Return the two columns of a CSV that tell places, and what they count in."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            rows = [{str(key).strip().lower(): value for key, value in row.items()} for row in csv.DictReader(lines)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{name} must be a CSV file, {path} cannot be read: {error}") from None
    for (one, other), unit in _COLUMNS.items():
        if rows and one in rows[0] and other in rows[0]:
            return _numbers(name, path, rows, one), _numbers(name, path, rows, other), unit
    wanted = " or ".join(",".join(pair) for pair in _COLUMNS)
    got = f"has the columns {','.join(rows[0])}" if rows else "has no points"
    raise ValueError(f"{name} must have the columns {wanted} and a point at least, {path} {got}")


def _numbers(name: str, path: Path, rows: list[dict[str, str]], column: str) -> np.ndarray:
    values = []
    for line, row in enumerate(rows, start=2):
        try:
            values.append(float(row[column]))
        except (TypeError, ValueError):
            values.append(np.nan)
        if not np.isfinite(values[-1]):
            raise ValueError(f"{name} must have a number for {column}, line {line} of {path} has {row[column]!r}")
    return np.array(values)
