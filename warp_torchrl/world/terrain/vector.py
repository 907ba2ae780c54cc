"""Points, lines and polygons of a file on a grid: GeoJSON and ESRI shapefiles.

Shapefiles are read with pyshp: it is pure Python, so the extra ``gis`` brings no second copy of GDAL beside rasterio's.
"""

import json
import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.grid import Grid

SUFFIXES = (".geojson", ".json", ".shp")
"""Of the files that are read here."""
_WGS84 = "EPSG:4326"
_log = logging.getLogger("warp_torchrl")


class Shape(NamedTuple):
    """One point, line or polygon in a grid's coordinates, and what its file says of it."""

    geometry: Mapping[str, Any]
    properties: Mapping[str, Any]


def read_shapes(name: str, path: Path, grid: Grid) -> list[Shape]:
    """Return the shapes of a file, each of one part, that touch the grid's box; those off it are counted in a warning.

    GeoJSON is in longitude and latitude (RFC 7946) unless it has a ``crs``, and in the grid's own coordinates where
    that is null; a shapefile is in the CRS of its ``.prj``, or in the grid's own coordinates where it has none.

    Args:
        name: What the file is, for messages.
        path: A file with one of ``SUFFIXES``.
        grid: The grid.

    Raises:
        ValueError: If the file cannot be read, has other shapes, cannot be placed, or lies off the grid as a whole.
    """
    features, crs = _read_shapefile(name, path) if path.suffix.lower() == ".shp" else _read_geojson(name, path)
    try:
        parts = [Shape(part, about) for geometry, about in features for part in _parts(geometry)]
        corners = [_points(part.geometry["coordinates"]) for part in parts]
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        raise ValueError(f"{name} must hold points, lines or polygons, {path} holds something else") from None
    moved = [_moved(name, part, at, crs, grid) for part, at in zip(parts, corners, strict=True)]
    near = [part for part in moved if _touches(part, grid)]
    if not near:
        raise ValueError(
            f"{name} must hold shapes on the map {_box(grid)}, {path} has {len(moved)}, none of them there"
        )
    if len(near) < len(moved):
        _log.warning(
            "%s: %d of %d shapes of %s lie off the map and are left out", name, len(moved) - len(near), len(moved), path
        )
    return near


def burn_in(shapes: Iterable[Shape], values: Iterable[float], grid: Grid) -> np.ndarray:
    """Return the sum of the values of the shapes in each cell, float64 [rows, columns].

    A polygon has the cells whose middle is in it, and where it is narrower than a cell those that it touches, as points
    and lines have.
    """
    from rasterio.enums import MergeAlg
    from rasterio.features import rasterize

    groups: dict[bool, list[tuple[Any, float]]] = {False: [], True: []}
    for shape, value in zip(shapes, values, strict=True):
        groups[_is_small(shape, grid)].append((shape.geometry, value))
    total = np.zeros(grid.shape)
    for touched, pairs in groups.items():
        if pairs:
            rasterize(
                pairs, out=total, transform=grid.transform, all_touched=touched, merge_alg=MergeAlg.add, dtype="float64"
            )
    return total


def in_grid(name: str, x: np.ndarray, y: np.ndarray, crs: Any, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates of a CRS, None for the grid's own, in the grid's; infinite where they are none there.

    Raises:
        ValueError: If the grid has no CRS to come to, or no way leads there.
    """
    from rasterio.warp import transform

    if grid.transform is None:
        raise ValueError(f"{name} must be a CSV of row,column where the landscape has no place on Earth")
    if crs is None or crs == grid.crs:
        return x, y
    if grid.crs is None:
        rule = 'x,y in a CSV or "crs": null in GeoJSON, as the map has no CRS'
        raise ValueError(f"{name} must have the map's own coordinates, {rule}, got {crs}")
    try:
        east, north = transform(crs, grid.crs, x, y)
    except Exception as error:  # of half a dozen classes, of rasterio, GDAL and PROJ
        raise ValueError(f"{name} must have a CRS that leads to {grid.crs}, got {crs}: {_line(error)}") from None
    return np.asarray(east), np.asarray(north)


def _read_geojson(name: str, path: Path) -> tuple[list[tuple[Any, Mapping[str, Any]]], Any]:
    """Return geometries with their properties, and the CRS; None is the grid's own."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict):
            raise ValueError("it is not an object")
        kind = document.get("type")
        features = document["features"] if kind == "FeatureCollection" else [document]
        pairs = [
            (each["geometry"], each.get("properties") or {}) if each.get("type") == "Feature" else (each, {})
            for each in features
        ]
        stated = document.get("crs", _WGS84)
        crs = stated["properties"]["name"] if isinstance(stated, dict) else stated
    except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{name} must be a GeoJSON file, {path} is none: {_line(error)}") from None
    return [pair for pair in pairs if pair[0] is not None], None if crs is None else _crs(name, crs)


def _read_shapefile(name: str, path: Path) -> tuple[list[tuple[Any, Mapping[str, Any]]], Any]:
    try:
        import shapefile
    except ImportError:
        raise ValueError(f'{name} must be read with pyshp, which is missing: pip install "warp_torchrl[gis]"') from None
    try:
        with shapefile.Reader(str(path)) as reader:
            pairs = [(each.shape, each.record) for each in reader.iterShapeRecords()]
            features = [(shape.__geo_interface__, record.as_dict()) for shape, record in pairs if shape.shapeType]
    except Exception as error:  # pyshp raises what struct, the file system and its own classes do
        raise ValueError(f"{name} must be a whole shapefile with its .shx and .dbf, {path}: {_line(error)}") from None
    about = path.with_suffix(".prj")
    if not about.is_file():
        _log.warning("%s: %s has no .prj, so its coordinates are taken for the map's own", name, path)
        return features, None
    return features, _crs(name, about.read_text(encoding="utf-8", errors="replace"))


def _crs(name: str, stated: object) -> Any:
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    try:
        return CRS.from_user_input(stated)
    except CRSError as error:
        raise ValueError(f"{name} must have a CRS that is known, got {stated!r}: {_line(error)}") from None


def _parts(geometry: Any) -> Iterator[Mapping[str, Any]]:
    """Return the points, lines and polygons of a geometry."""
    kind = geometry["type"]
    if kind == "GeometryCollection":
        for each in geometry["geometries"]:
            yield from _parts(each)
    elif kind in ("MultiPoint", "MultiLineString", "MultiPolygon"):
        for part in geometry["coordinates"]:
            yield from _parts({"type": kind.removeprefix("Multi"), "coordinates": part})
    elif kind in ("Point", "LineString", "Polygon") and _is_whole(kind, geometry["coordinates"]):
        yield {"type": kind, "coordinates": geometry["coordinates"]}
    else:
        raise ValueError(kind)


def _is_whole(kind: str, coordinates: Any) -> bool:
    """Return whether a line has two points, and each ring of a polygon four."""
    if kind == "Polygon":
        return len(coordinates) > 0 and all(len(ring) >= 4 for ring in coordinates)
    return len(coordinates) >= 2


def _points(coordinates: Any) -> np.ndarray:
    """Return the corners of coordinates of any depth, float64 [n, 2]."""
    if not isinstance(coordinates[0], list | tuple):
        x, y = (float(each) for each in coordinates[:2])
        return np.array([[x, y]])
    return np.concatenate([_points(each) for each in coordinates])


def _moved(name: str, shape: Shape, corners: np.ndarray, crs: Any, grid: Grid) -> Shape:
    x, y = in_grid(name, corners[:, 0], corners[:, 1], crs, grid)
    places = iter(zip(x.tolist(), y.tolist(), strict=True))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError(f"{name} must have coordinates that {grid.crs} can hold, got {corners[0].tolist()}")
    geometry = {"type": shape.geometry["type"], "coordinates": _rebuilt(shape.geometry["coordinates"], places)}
    return Shape(geometry, shape.properties)


def _rebuilt(coordinates: Any, places: Iterator[tuple[float, float]]) -> Any:
    if not isinstance(coordinates[0], list | tuple):
        return next(places)
    return [_rebuilt(each, places) for each in coordinates]


def _touches(shape: Shape, grid: Grid) -> bool:
    (west, south), (east, north) = _corners(shape)
    left, bottom, right, top = grid.bounds
    return bool(west < right and left <= east and south <= top and bottom < north)


def _is_small(shape: Shape, grid: Grid) -> bool:
    """Return whether a shape has the cells that it touches, and not those whose middle is in it."""
    low, high = _corners(shape)
    return shape.geometry["type"] != "Polygon" or bool((high - low).min() < abs(grid.transform[0]))


def _corners(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    places = _points(shape.geometry["coordinates"])
    return places.min(0), places.max(0)


def _box(grid: Grid) -> list[float]:
    return [round(each, 1) for each in grid.bounds]


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
