"""Perimeters of a fire as GeoJSON (RFC 7946), from the times when cells burned."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from warp_torchrl.system import disk
from warp_torchrl.world.terrain.geotiff import NO_RASTERIO_TO_WRITE, as_array, check_window, window_transform
from warp_torchrl.world.terrain.grid import Grid

_DECIMALS = 7  # of a degree: a centimetre
_NO_PLACE = "coordinates are those of the grid, which has no CRS; they are not longitude and latitude"
LinearRing = Sequence[Sequence[float]]
"""Places (x, y) round an area, the last being the first."""


def perimeters(
    arrival: Tensor | np.ndarray,
    grid: Grid,
    minutes: Sequence[float] | None = None,
    corner: tuple[int, int] = (0, 0),
) -> dict[str, Any]:
    """Return the outlines of the cells burned by some times, as a GeoJSON FeatureCollection.

    Each time is one feature, a MultiPolygon of the burned cells' outer edges, islands cut out; cells that touch at a
    corner only are apart. A time at which nothing had burned has no feature. Its properties are ``minutes``, ``hours``
    and ``area_ha``. Where the grid has a CRS the coordinates are WGS84 longitude and latitude, else those of the grid,
    and ``note`` says so.

    Args:
        arrival: When each cell burned, [rows, columns] [min], NaN or infinite where it never did; or what burned, bool.
        grid: The grid that it lies on.
        minutes: The times [min], for numbers; none for a bool.
        corner: (row, column) of the first cell in the grid.

    Raises:
        ValueError: If the shape does not fit in the grid, times are missing or given for a bool, the grid's cells are
            not squares in metres, or rasterio is not installed.
    """
    burned_at = as_array(arrival)
    check_window({"arrival": burned_at}, grid, corner)
    if not grid.is_metric:
        raise ValueError(f"grid must have square cells in metres, north up, got {grid.transform[:6]} in {grid.crs}")
    if (burned_at.dtype == bool) != (minutes is None):
        raise ValueError(f"minutes must be given for arrival times, and not for truths, got {minutes}")
    times = [(None, burned_at)] if minutes is None else [(minute, burned_at <= minute) for minute in minutes]
    features = [_feature(burned, grid, corner, minute) for minute, burned in times if burned.any()]
    note = {} if grid.crs else {"note": _NO_PLACE}
    return {"type": "FeatureCollection", **note, "features": features}


def write_geojson(path: Path, collection: Mapping[str, Any]) -> None:
    """Write GeoJSON, whole or not at all.

    Raises:
        OSError: If the write fails, with the path.
    """
    disk.replace(path, json.dumps(collection, allow_nan=False))


def _feature(burned: np.ndarray, grid: Grid, corner: tuple[int, int], minute: float | None) -> dict[str, Any]:
    time = {} if minute is None else {"minutes": float(minute), "hours": float(minute) / 60.0}
    area = float(burned.sum()) * grid.cell_size**2 / 10_000.0
    polygons = [
        [_turned(ring, index == 0) for index, ring in enumerate(each)] for each in _polygons(burned, grid, corner)
    ]
    geometry = {"type": "MultiPolygon", "coordinates": polygons}
    return {"type": "Feature", "properties": {**time, "area_ha": area}, "geometry": geometry}


def _polygons(burned: np.ndarray, grid: Grid, corner: tuple[int, int]) -> list[list[LinearRing]]:
    """Return the rings of each patch of burned cells, the outer one first, in longitude and latitude if possible."""
    try:
        from rasterio.features import shapes
        from rasterio.warp import transform_geom
    except ImportError:
        raise ValueError(NO_RASTERIO_TO_WRITE) from None
    found = shapes(burned.astype(np.uint8), mask=burned, connectivity=4, transform=window_transform(grid, corner))
    patches = [geometry for geometry, _ in found]
    if not grid.crs:
        return [each["coordinates"] for each in patches]
    moved = transform_geom(grid.crs, "EPSG:4326", patches, precision=_DECIMALS)
    return [
        rings
        for each in moved  # a patch over the antimeridian comes back as several
        for rings in (each["coordinates"] if each["type"] == "MultiPolygon" else [each["coordinates"]])
    ]


def _turned(ring: LinearRing, is_outer: bool) -> LinearRing:
    """Return a ring that runs counter-clockwise where it is an outer one, clockwise where it is a hole."""
    x, y = np.asarray(ring, np.float64)[:, :2].T
    x, y = x - x[0], y - y[0]  # of large coordinates a difference would lose its last digits
    twice_area = float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum())
    return ring if (twice_area > 0.0) == is_outer else ring[::-1]
