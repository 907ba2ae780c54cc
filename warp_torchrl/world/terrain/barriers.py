"""Barriers on a map: roads, rivers and dozer lines as cells without fire."""

from os import PathLike
from pathlib import Path

import numpy as np

from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.vector import SUFFIXES, Shape, mark, read_shapes

_NAME = "barriers"


def read_barriers(path: str | PathLike[str], grid: Grid, width: float = 0.0) -> np.ndarray:
    """Return the cells of a grid that barriers close, bool [rows, columns].

    A line closes the cells that it touches, and those whose middle is within half of its width; a polygon the cells
    of ``vector.mark``. Fire goes across corners, so no two of them hang together by a corner alone.

    Args:
        path: GeoJSON or a shapefile of lines or polygons.
        grid: The grid.
        width: Of lines [m].

    Raises:
        ValueError: If the file is missing or damaged, has points, or lies off the map.
    """
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES or not file.is_file():
        raise ValueError(f"{_NAME} must name a file of lines or polygons, one of {', '.join(SUFFIXES)}, got {path}")
    shapes = read_shapes(_NAME, file, grid)
    if any(shape.part.kind == "Point" for shape in shapes):
        raise ValueError(f"{_NAME} must be lines or polygons, {path} has points")
    cells = mark(shapes, grid)
    for shape in shapes:
        if shape.part.kind == "LineString" and width > 0.0:
            _widen(cells, shape, grid, 0.5 * width / grid.cell_size)
    return closed(cells)


def closed(cells: np.ndarray) -> np.ndarray:
    """Return cells with those added by which none hang together by a corner alone, bool [rows, columns]."""
    cells = cells.copy()
    while True:
        north_west, north_east, south_west, south_east = cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]
        falls = north_west & south_east & ~north_east & ~south_west
        rises = north_east & south_west & ~north_west & ~south_east
        if not (falls.any() or rises.any()):
            return cells
        north_east |= falls
        north_west |= rises


def _widen(cells: np.ndarray, line: Shape, grid: Grid, reach: float) -> None:
    """Mark the cells whose middle is within a reach of a line [cells]."""
    inverse, (x, y) = ~grid.transform, line.corners.T
    column, row = (inverse[at] * x + inverse[at + 1] * y + inverse[at + 2] - 0.5 for at in (0, 3))
    for begin, end in zip(range(len(row) - 1), range(1, len(row)), strict=True):
        (top, bottom), (left, right) = (
            np.clip((min(way[begin], way[end]) - reach, max(way[begin], way[end]) + reach + 1.0), 0, side).astype(int)
            for way, side in zip((row, column), cells.shape, strict=True)
        )
        south, east = row[end] - row[begin], column[end] - column[begin]
        down = np.arange(top, bottom)[:, None] - row[begin]
        across = np.arange(left, right)[None] - column[begin]
        along = np.clip((down * south + across * east) / max(south * south + east * east, 1e-12), 0.0, 1.0)
        away = np.hypot(down - along * south, across - along * east)
        cells[top:bottom, left:right] |= away <= reach
