"""Points, lines and polygons of a file on a grid, and the cells that they mark."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.crs import project
from warp_torchrl.world.terrain.features import SUFFIXES, GeometryPart, read_features
from warp_torchrl.world.terrain.gdal import reading
from warp_torchrl.world.terrain.grid import Grid

__all__ = ["SUFFIXES", "Shape", "burn_in", "in_grid", "mark", "read_shapes"]
_EDGE = 2  # cells
_log = logging.getLogger("warp_torchrl")


class Shape(NamedTuple):
    """One point, line or polygon in a grid's coordinates, with its properties."""

    part: GeometryPart
    properties: Mapping[str, Any]
    feature: int  # its place in the file: parts of one feature have the same

    @property
    def corners(self) -> np.ndarray:
        """Return all corners, float64 [n, 2]."""
        return np.concatenate(self.part.rings)


def read_shapes(name: str, path: Path, grid: Grid) -> list[Shape]:
    """Return the shapes of a file, each of one part, that touch the grid's box; those off it are counted in a warning.

    Args:
        name: What the file is, for messages.
        path: A file with one of ``SUFFIXES``; see ``read_features``.
        grid: The grid.

    Raises:
        ValueError: If the file cannot be read, has other shapes, cannot be placed, or lies off the grid as a whole.
    """
    features, crs = read_features(name, path, placed=grid.crs is not None)
    parts = [(part, each.properties, place) for place, each in enumerate(features) for part in each.parts]
    moved = [Shape(_moved(name, part, crs, grid), about, place) for part, about, place in parts]
    near = [shape for shape in moved if _touches(shape, grid)]
    if not near:
        got = f"{path} has {len(moved)}, none of them there"
        raise ValueError(f"{name} must hold shapes on the map {[round(each, 1) for each in grid.bounds]}, {got}")
    if len(near) < len(moved):
        _log.warning(
            "%s: %d of %d shapes of %s lie off the map and are left out", name, len(moved) - len(near), len(moved), path
        )
    return near


def burn_in(shapes: Iterable[Shape], values: Iterable[float], grid: Grid) -> np.ndarray:
    """Return the sum of the values of the features that mark each cell, float64 [rows, columns].

    Args:
        shapes: In the order of their file.
        values: Of each shape's feature.
        grid: The grid.
    """
    total = np.zeros(_beyond(grid))
    pairs = zip(shapes, values, strict=True)
    for _, group in groupby(pairs, key=lambda pair: pair[0].feature):
        parts, worth = zip(*group, strict=True)
        windows = [_window(shape, grid) for shape in parts]
        rows, columns = (_hull([window[axis] for window in windows]) for axis in (0, 1))
        total[rows, columns] += worth[0] * _marked(parts, grid, rows, columns)
    return total[_EDGE:-_EDGE, _EDGE:-_EDGE]


def mark(shapes: Iterable[Shape], grid: Grid) -> np.ndarray:
    """Return the cells that shapes mark, bool [rows, columns].

    A point marks its cell, a line the cells that it touches, a polygon the cells whose middle is inside. If these leave
    a part of the polygon more than a cell away, or are not connected, the polygon is narrower than a cell somewhere.
    Then it also marks the cells that it touches, except at the edge of its wide parts, next to four marked cells in a
    square.
    """
    cells = np.zeros(_beyond(grid), bool)
    for shape in shapes:
        rows, columns = _window(shape, grid)
        cells[rows, columns] |= _marked([shape], grid, rows, columns)
    return cells[_EDGE:-_EDGE, _EDGE:-_EDGE]


def in_grid(name: str, x: np.ndarray, y: np.ndarray, crs: Any, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates of a CRS, None for the grid's, in the grid's CRS; infinite where they have none there.

    Raises:
        ValueError: If the grid has no CRS, or no transformation leads there.
    """
    if grid.transform is None:
        raise ValueError(f"{name} must be a CSV of row,column where the landscape has no place on Earth")
    if crs is None or crs == grid.crs:
        return x, y
    if grid.crs is None:
        rule = 'x,y in a CSV or "crs": null in GeoJSON, as the map has no CRS'
        raise ValueError(f"{name} must have the map's own coordinates, {rule}, got {crs}")
    return project(name, x, y, crs, grid.crs)


def _moved(name: str, part: GeometryPart, crs: Any, grid: Grid) -> GeometryPart:
    """Return a part in the grid's coordinates."""
    corners = np.concatenate(part.rings)
    x, y = in_grid(name, corners[:, 0], corners[:, 1], crs, grid)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError(f"{name} must have coordinates that {grid.crs} can hold, got {corners[0].tolist()}")
    ends = np.cumsum([len(ring) for ring in part.rings])[:-1]
    return GeometryPart(part.kind, np.split(np.stack((x, y), axis=1), ends))


def _touches(shape: Shape, grid: Grid) -> bool:
    (west, south), (east, north) = shape.corners.min(0), shape.corners.max(0)
    left, bottom, right, top = grid.bounds
    return bool(west < right and left <= east and south <= top and bottom < north)


def _beyond(grid: Grid) -> tuple[int, int]:
    """Return the shape of a grid with some cells beyond each edge: polygons there can mark cells inside."""
    return grid.shape[0] + 2 * _EDGE, grid.shape[1] + 2 * _EDGE


def _window(shape: Shape, grid: Grid) -> tuple[slice, slice]:
    """Return the rows and columns about a shape, of the grid with its edge."""
    inverse, (x, y) = ~grid.transform, shape.corners.T
    places = (inverse[at] * x + inverse[at + 1] * y + inverse[at + 2] for at in (3, 0))
    ends = [np.clip((each.min(), each.max() + 2 * _EDGE + 1), 0, side) for each, side in zip(places, _beyond(grid))]
    return slice(*(int(end) for end in ends[0])), slice(*(int(end) for end in ends[1]))


def _hull(slices: list[slice]) -> slice:
    return slice(min(each.start for each in slices), max(each.stop for each in slices))


def _marked(shapes: Sequence[Shape], grid: Grid, rows: slice, columns: slice) -> np.ndarray:
    """Return the cells of a window that some shapes mark, bool."""
    size = rows.stop - rows.start, columns.stop - columns.start
    cells = np.zeros(size, bool)
    (a, b, left, d, e, top), column, row = grid.transform[:6], columns.start - _EDGE, rows.start - _EDGE
    place = type(grid.transform)(a, b, left + a * column + b * row, d, e, top + d * column + e * row)
    with reading("shapes must be put on the map, which fails"):
        for shape in shapes:
            touched = _cells_of(shape, size, place, all_touched=True)
            if shape.part.kind == "Polygon":
                touched = _whole(_cells_of(shape, size, place, all_touched=False), touched)
            cells |= touched
    return cells


def _cells_of(shape: Shape, size: tuple[int, int], place: Any, all_touched: bool) -> np.ndarray:
    from rasterio.features import rasterize

    rings = [ring.tolist() for ring in shape.part.rings]
    coordinates = {"Point": rings[0][0], "LineString": rings[0], "Polygon": rings}[shape.part.kind]
    geometry = {"type": shape.part.kind, "coordinates": coordinates}
    return rasterize([geometry], size, transform=place, all_touched=all_touched, dtype="uint8") > 0


def _whole(inside: np.ndarray, touched: np.ndarray) -> np.ndarray:
    """Return the cells of a polygon from cells with their middle inside and cells that it touches; see ``mark``."""
    if not (touched & ~_near(inside)).any() and _is_one_piece(inside):
        return inside
    cells = inside | (touched & ~_near(_blocks(inside)))
    return cells | (touched & (_parts_sides(cells) | _parts_sides(cells.T).T))


def _near(cells: np.ndarray) -> np.ndarray:
    """Return cells and those about them."""
    padded = np.pad(cells, 1)
    across = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    return across[:-2] | across[1:-1] | across[2:]


def _blocks(cells: np.ndarray) -> np.ndarray:
    """Return the cells that are one of four in a square."""
    padded = np.pad(cells, 1)
    corners = padded[:-1, :-1] & padded[1:, :-1] & padded[:-1, 1:] & padded[1:, 1:]
    return corners[:-1, :-1] | corners[1:, :-1] | corners[:-1, 1:] | corners[1:, 1:]


def _parts_sides(cells: np.ndarray) -> np.ndarray:
    """Return the cells that connect cells on both sides, one row off at most, with none above, at or below."""
    padded = np.pad(cells, 1)
    along = padded[:-2] | padded[1:-1] | padded[2:]
    return along[:, :-2] & along[:, 2:] & ~along[:, 1:-1]


def _is_one_piece(cells: np.ndarray) -> bool:
    """Return whether cells are connected, by sides or corners."""
    from rasterio.features import shapes

    pieces = shapes(cells.astype(np.uint8), mask=cells, connectivity=8)
    return next(pieces, None) is not None and next(pieces, None) is None
