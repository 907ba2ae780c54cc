"""Cells of a grid that a file marks: points in a CSV, a raster, or the shapes of a vector file."""

import logging
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.system.delimited import SEPARATORS, named_separator, read_table_text, split_rows, to_number, to_points
from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import RASTERS, read_header, read_layer
from warp_torchrl.world.terrain.vector import SUFFIXES, in_grid, mark, read_shapes

_COLUMNS = {
    ("row", "column"): "cells",
    ("x", "y"): "map",
    ("longitude", "latitude"): "EPSG:4326",
    ("lon", "lat"): "EPSG:4326",
    ("row", "col"): "cells",
    ("easting", "northing"): "map",
    ("lng", "lat"): "EPSG:4326",
    ("long", "lat"): "EPSG:4326",
}
"""Pairs of columns of a CSV, and what they count in."""
_TIMES: Mapping[str, float | None] = {
    **dict.fromkeys(("hour", "hours"), 60.0),
    **dict.fromkeys(("minute", "minutes"), 1.0),
    **dict.fromkeys(("datetime", "time", "date_time", "timestamp")),
}
"""Names of columns and properties of times, and the minutes of their unit; None: a date and time."""
_LATEST = 1e8  # minutes
_SHOWN = 4
"""Pairs that a message names."""
_LARGEST = (255, 32767, 65535)  # of bytes and of words
_log = logging.getLogger("warp_torchrl")


class _Points(NamedTuple):
    """Points of a CSV."""

    first: np.ndarray  # their two coordinates, float64 [n] each
    second: np.ndarray
    unit: str
    time: tuple[str, list[str]] | None = None  # name of the column of times, and its cells


def read_cells(name: str, path: str | PathLike[str], grid: Grid) -> np.ndarray:
    """Return the cells of a grid that a file marks, bool [rows, columns]; at least one.

    Shapes mark cells as ``vector.mark`` says, a point of a CSV the cell that contains it, and a raster the cells over 0
    and not nodata. Marks off the grid are ignored, and counted in a warning.

    Args:
        name: Name of the file in messages.
        path: A CSV of ``row,column`` (from 0), ``x,y`` (in the grid's CRS) or ``longitude,latitude``, with any
            separator and, with semicolons, decimal commas; a raster (.tif, .asc) on the grid; GeoJSON or a
            shapefile (see ``read_shapes``).
        grid: The grid; its transform is None where the landscape has no place on Earth.

    Raises:
        ValueError: If the file is missing, damaged or of no such kind, or marks no cell.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in (".csv", *RASTERS, *SUFFIXES) or not file.is_file():
        kinds = ", ".join((".csv", *RASTERS, *SUFFIXES))
        raise ValueError(f"{name} must name a file that exists, one of {kinds}, got {path}")
    if suffix == ".csv":
        cells = _read_points(name, file, grid)
    elif suffix in SUFFIXES:
        cells = mark(read_shapes(name, file, grid), grid)
    else:
        cells = read_marks(name, file, grid)
    if not cells.any():
        raise ValueError(f"{name} must mark a cell of the map, {path} marks none")
    return cells


def read_times(name: str, path: str | PathLike[str], grid: Grid, moment: Callable[[str], float]) -> np.ndarray | None:
    """Return when a file marks each cell of a grid [minutes], float32 [rows, columns]; infinite where it never does.

    A CSV has a column, and shapes have a property, ``hour`` or ``minute`` (a number), or ``time`` or ``datetime`` (a
    date and time). Of two times of a cell the earlier counts.

    Args:
        name: See ``read_cells``.
        path: A file that ``read_cells`` has read.
        grid: The grid.
        moment: Returns the minutes of a date and time.

    Returns:
        The times, or None if the file has none, as a raster.

    Raises:
        ValueError: If some marks have a time and others none, or a time cannot be read.
    """
    file = Path(path)
    if file.suffix.lower() in RASTERS:
        return None
    found = (_times_of_points if file.suffix.lower() == ".csv" else _times_of_shapes)(name, file, grid)
    if found is None:
        return None
    times, read = np.full(grid.shape, np.inf, np.float32), dict[Any, float]()
    for number, (key, value, where) in enumerate(found, start=1):
        if value in (None, ""):
            raise ValueError(f"{name} must have a time for each mark or for none, {path} has none for mark {number}")
        if value not in read:
            read[value] = _minutes(name, file, key, value, moment)
        times[where] = np.minimum(times[where], read[value])
    return times


def _times_of_points(name: str, path: Path, grid: Grid) -> list[tuple[str, Any, Any]] | None:
    """Return the column of times, the time and the place of each point on the grid; None without such a column."""
    points = _read_pairs(name, path)
    if points.time is None:
        return None
    row, column, inside = _cells_of(name, path, grid, points)
    key, told = points.time
    return [(key, told[at], (int(row[at]), int(column[at]))) for at in np.flatnonzero(inside)]


def _times_of_shapes(name: str, path: Path, grid: Grid) -> list[tuple[str, Any, Any]] | None:
    """Return the property of the time, the time and the cells of each shape; None where no shape has one."""
    shapes = read_shapes(name, path, grid)
    found = [_time_property(shape.properties) for shape in shapes]
    if not any(found):
        return None
    return [(*(told or ("", None)), mark([shape], grid)) for shape, told in zip(shapes, found, strict=True)]


def _time_property(properties: Mapping[str, Any]) -> tuple[str, Any] | None:
    """Return the name and the value of the property that tells a time."""
    told = {_column(str(name)): value for name, value in properties.items()}
    return next(((name, told[name]) for name in _TIMES if told.get(name) is not None), None)


def _minutes(name: str, path: Path, key: str, value: Any, moment: Callable[[str], float]) -> float:
    """Return the minutes of a time that a file tells."""
    unit = _TIMES[key]
    if unit is None:
        return moment(str(value))
    number = to_number(str(value))
    if number is None or not 0.0 <= number * unit <= _LATEST:
        raise ValueError(f"{name} must have a number of 0 or more for {key}, {path} has {value!r}")
    return number * unit


def read_marks(name: str, path: Path, grid: Grid) -> np.ndarray:
    """Return the cells of a raster on a grid that are over 0 and not nodata, bool [rows, columns].

    Numbers below 0 mark nothing, as the -9999 of files that declare no nodata. The largest number of a type, 255 of
    bytes, may be nodata that was not declared, too: beside other marks, or on most of the map, it is refused.

    Raises:
        ValueError: If the file cannot be read, does not lie on the grid, or does not say what is nodata.
    """
    values, known = read_on_grid(name, path, grid)
    marks = known & (values > 0) & np.isfinite(values)
    kinds = np.unique(values[marks])
    if len(kinds) and (kinds[-1] in _LARGEST or kinds[-1] >= 2**31 - 1):
        rule = f"{name} must say what is nodata (gdal_edit -a_nodata), {path} marks"
        if len(kinds) > 1:
            raise ValueError(f"{rule} cells by {kinds[0]:g} and by {kinds[-1]:g}")
        if known.all() and 2 * int(marks.sum()) > marks.size:
            raise ValueError(f"{rule} {int(marks.sum())} of {marks.size} cells by {kinds[-1]:g}, and leaves the others")
    return marks


def read_on_grid(name: str, path: Path, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a raster that lies on a grid, and where they are known, [rows, columns] and bool.

    Raises:
        ValueError: If the file cannot be read, or does not lie on the grid.
    """
    header = read_header(name, path, metric=False)
    check_lies_on(name, header.grid, grid)
    return read_layer(name, path, header.number)


def check_lies_on(name: str, own: Grid, grid: Grid) -> None:
    """Refuse a raster whose grid is not the landscape's; if one has no CRS, it is assumed to be the other's.

    Raises:
        ValueError: With what differs.
    """
    if own.crs is None or grid.crs is None:  # an ASCII grid has none: its place tells enough
        own = own._replace(crs=grid.crs)
    if grid.transform is not None:
        check_grid(name, own, "the landscape", grid)
    elif own.shape != grid.shape:
        raise ValueError(f"{name} must have the shape of the landscape, {grid.shape}, got {own.shape}")


def _read_points(name: str, path: Path, grid: Grid) -> np.ndarray:
    """Return the cells that the points of a CSV lie in."""
    row, column, inside = _cells_of(name, path, grid, _read_pairs(name, path))
    cells = np.zeros(grid.shape, bool)
    cells[row[inside].astype(int), column[inside].astype(int)] = True
    return cells


def _cells_of(name: str, path: Path, grid: Grid, points: _Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row and column of the points of a CSV, and which lie on the grid; one at least does."""
    first, second, unit = points.first, points.second, points.unit
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
    return row, column, inside


def _read_pairs(name: str, path: Path) -> _Points:
    """Return the two columns of coordinates of a CSV, their unit, and the column of times."""
    named, text = named_separator(read_table_text(name, path))
    headers: list[str] = []
    for separator in [named] if named else SEPARATORS:
        try:
            table = split_rows(text, separator)
        except ValueError:  # quotes stand otherwise
            continue
        lines = [number for number, row in enumerate(table) if row and not row[0].startswith("#")]
        first = [_column(cell) for cell in table[lines[0]]] if lines else []
        for (one, other), unit in _COLUMNS.items():
            if one in first and other in first:
                _check_table(name, path, table, lines, (one, other))
                places = first.index(one), first.index(other)
                x, y = (_numbers(name, path, table, lines, place, separator) for place in places)
                timed = next((first.index(key) for key in _TIMES if key in first), None)
                _tell(name, path, table[lines[0]], places, unit, timed)
                if timed is None:
                    return _Points(x, y, unit)
                cells = [table[line][timed].strip() if timed < len(table[line]) else "" for line in lines[1:]]
                return _Points(x, y, unit, (first[timed], cells))
        headers = headers or first
    wanted = " or ".join(",".join(pair) for pair in list(_COLUMNS)[:_SHOWN])
    got = f"has the columns {','.join(headers)}" if headers else "has no points"
    raise ValueError(f"{name} must have the columns {wanted} and a point at least, {path} {got}")


def _check_table(name: str, path: Path, table: list[list[str]], lines: list[int], pair: tuple[str, str]) -> None:
    """Refuse a table without points, with a column twice, or with more cells in a row than in its first."""
    headers = [_column(cell) for cell in table[lines[0]]]
    if len(lines) < 2:
        raise ValueError(f"{name} must have a point at least, {path} has no points")
    for column in pair:
        if headers.count(column) > 1:
            raise ValueError(f"{name} must have one column {column}, {path} has {headers.count(column)}")
    for line in lines[1:]:
        if any(table[line][len(headers) :]):
            count = len(table[line])
            raise ValueError(
                f"{name} must have {len(headers)} cells in each row, line {line + 1} of {path} has {count}"
            )


def _column(header: str) -> str:
    """Return a column's name in lower case, without what stands in brackets."""
    return header.lower().partition("(")[0].partition("[")[0].strip()


def _numbers(name: str, path: Path, table: list[list[str]], lines: list[int], place: int, separator: str) -> np.ndarray:
    """Return the numbers of a column; a message names the line of the file."""
    header, *cells = (table[line][place] if place < len(table[line]) else "" for line in lines)
    try:
        cells = to_points(header, cells, separator)
    except ValueError as error:
        raise ValueError(f"{name}: column {error} in {path}") from None
    values = [to_number(cell) for cell in cells]
    if None in values:
        at = values.index(None)
        line, got = lines[1 + at] + 1, cells[at] or None
        raise ValueError(f"{name} must have a number for {_column(header)}, line {line} of {path} has {got!r}")
    return np.array(values, dtype=np.float64)


def _tell(
    name: str, path: Path, headers: list[str], places: tuple[int, int], unit: str, timed: int | None = None
) -> None:
    """Report the columns that were read, their unit, and the ignored columns."""
    units = {"cells": "cells of the map, from 0", "map": "the map's coordinates"}
    read = {headers[place]: units.get(unit, f"degrees of {unit}") for place in places}
    if timed is not None:
        read[headers[timed]] = "time"
    left = tuple(header for place, header in enumerate(headers) if place not in (*places, timed) and header)
    report_file(Provenance(key=name, file=str(path), read=read, left=left))
