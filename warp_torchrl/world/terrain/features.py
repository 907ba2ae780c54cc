"""Features of GeoJSON files and ESRI shapefiles: geometries, properties and CRS.

Shapefiles are read with pyshp: it is pure Python, so the extra ``gis`` brings no second copy of GDAL beside rasterio's.
"""

import json
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.crs import WGS84, stated_crs

SUFFIXES = (".geojson", ".json", ".shp")
"""Of the files that are read here."""
MOST_CORNERS = 1_000_000
"""Corners of all shapes of a file at most."""
_LARGEST_FILE = 256 * 2**20  # bytes
_DEEPEST = 8  # collections in collections
_log = logging.getLogger("warp_torchrl")


class GeometryPart(NamedTuple):
    """One point, line or polygon."""

    kind: str  # Point, LineString or Polygon
    rings: list[np.ndarray]  # float64 [n, 2] each: one, and of a polygon its holes behind the outer one


class Feature(NamedTuple):
    """Content of a file about one place."""

    parts: list[GeometryPart]
    properties: Mapping[str, Any]


def read_features(name: str, path: Path, placed: bool = True) -> tuple[list[Feature], Any]:
    """Return the features of a file that have a geometry, and their CRS; None is the map's own coordinates.

    GeoJSON is in longitude and latitude (RFC 7946) unless it has a ``crs``, and in the map's own coordinates where
    that is null, or neither it nor the map has one; a shapefile is in the CRS of its ``.prj``, or in the map's own
    coordinates where it has none.

    Args:
        name: What the file is, for messages.
        path: A file with one of ``SUFFIXES``.
        placed: Whether the map has a CRS.

    Raises:
        ValueError: If the file cannot be read, is enormous, states a CRS that is not known, or has other shapes.
    """
    is_shapefile = path.suffix.lower() == ".shp"
    _check_size(name, path, is_shapefile)
    pairs, crs = _read_shapefile(name, path) if is_shapefile else _read_geojson(name, path, placed)
    try:
        features = [Feature(list(_parts(geometry)), about) for geometry, about in pairs if geometry is not None]
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError):
        raise ValueError(f"{name} must hold points, lines or polygons, {path} holds something else") from None
    corners = [ring for feature in features for part in feature.parts for ring in part.rings]
    if not all(np.isfinite(ring).all() for ring in corners):
        raise ValueError(f"{name} must have finite coordinates, {path} has others")
    if crs is not None and crs.is_geographic and corners:
        _check_degrees(name, path, corners)
    return features, crs


def _check_size(name: str, path: Path, is_shapefile: bool) -> None:
    """Refuse enormous files before they are parsed."""
    sizes = [each.stat().st_size for each in (path, path.with_suffix(".dbf")) if each.is_file()]
    if max(sizes) > _LARGEST_FILE:
        raise ValueError(f"{name} must have at most {_LARGEST_FILE} bytes, {path} has {max(sizes)}")
    corners = sizes[0] // 16 if is_shapefile else path.read_bytes().count(b"[")  # two numbers of 8 bytes; a list each
    if corners > MOST_CORNERS:
        raise ValueError(f"{name} must have at most {MOST_CORNERS} corners, {path} has about {corners}")


def _check_degrees(name: str, path: Path, corners: list[np.ndarray]) -> None:
    """Refuse degrees that are metres in fact."""
    x, y = np.abs(np.concatenate(corners)).max(0)
    if x > 360.0 or y > 90.0:
        rule = 'longitude and latitude where it states no CRS, as GeoJSON does by its member "crs"'
        raise ValueError(f"{name} must be in {rule}, {path} has coordinates up to {x:.6g}, {y:.6g}")


def _read_geojson(name: str, path: Path, placed: bool) -> tuple[list[tuple[Any, Mapping[str, Any]]], Any]:
    """Return geometries with their properties, and the CRS."""
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
        if not isinstance(document, dict):
            raise ValueError("it is not an object")
        kind = document.get("type")
        features = document["features"] if kind == "FeatureCollection" else [document]
        pairs = [
            (each["geometry"], each.get("properties") or {}) if each.get("type") == "Feature" else (each, {})
            for each in features
        ]
        if not all(isinstance(about, dict) for _, about in pairs):
            raise ValueError("properties are not an object")
        stated = _stated(document.get("crs", WGS84 if placed else None))
    except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{name} must be a GeoJSON file, {path} is none: {_line(error)}") from None
    if not placed and "crs" not in document:
        _log.warning("%s: %s has no crs, so its coordinates are taken for the map's own, which has none", name, path)
    return pairs, None if stated is None else stated_crs(name, stated)


def _stated(crs: Any) -> Any:
    """Return the name that a GeoJSON's member ``crs`` has, or the code of its first version."""
    if not isinstance(crs, dict):
        return crs
    about = crs.get("properties")
    told = (about.get("name"), about.get("code")) if isinstance(about, dict) else (None, None)
    if told == (None, None):
        raise ValueError("its crs has no name")
    return told[0] if told[0] is not None else told[1]


def _read_shapefile(name: str, path: Path) -> tuple[list[tuple[Any, Mapping[str, Any]]], Any]:
    try:
        import shapefile
    except ImportError:
        raise ValueError(f'{name} must be read with pyshp, which is missing: pip install "warp_torchrl[gis]"') from None
    try:
        with shapefile.Reader(str(path), encodingErrors="replace") as reader:  # names and numbers are ASCII in all
            pairs = [(each.shape, each.record) for each in reader.iterShapeRecords()]
            features = [(shape.__geo_interface__, record.as_dict()) for shape, record in pairs if shape.shapeType]
    except Exception as error:  # pyshp raises what struct, the file system and its own classes do
        raise ValueError(f"{name} must be a whole shapefile with its .shx and .dbf, {path}: {_line(error)}") from None
    about = path.with_suffix(".prj")
    if not about.is_file():
        _log.warning("%s: %s has no .prj, so its coordinates are taken for the map's own", name, path)
        return features, None
    with about.open("rb") as file:
        return features, stated_crs(name, file.read(_LARGEST_FILE).decode("utf-8-sig", "replace"))


def _parts(geometry: Any, depth: int = 0) -> Iterator[GeometryPart]:
    """Return the points, lines and polygons of a geometry."""
    kind = geometry["type"]
    if kind == "GeometryCollection" and depth < _DEEPEST:
        for each in geometry["geometries"]:
            yield from _parts(each, depth + 1)
    elif kind in ("MultiPoint", "MultiLineString", "MultiPolygon"):
        for part in geometry["coordinates"]:
            yield _part(kind.removeprefix("Multi"), part)
    elif kind in ("Point", "LineString", "Polygon"):
        yield _part(kind, geometry["coordinates"])
    else:
        raise ValueError(kind)


def _part(kind: str, coordinates: Any) -> GeometryPart:
    """Return a part of at least a point, a line of two, or a polygon of rings of four."""
    lines = coordinates if kind == "Polygon" else [coordinates] if kind == "LineString" else [[coordinates]]
    rings = [_places(line) for line in lines]
    least = {"Point": 1, "LineString": 2, "Polygon": 4}[kind]
    if not rings or any(len(ring) < least for ring in rings):
        raise ValueError(kind)
    return GeometryPart(kind, rings)


def _places(line: Any) -> np.ndarray:
    """Return places, each a list of x, y and maybe more, as float64 [n, 2]."""
    if not all(isinstance(place, list | tuple) and len(place) >= 2 and bool not in map(type, place) for place in line):
        raise ValueError("places")
    places = np.array([place[:2] for place in line])
    if places.dtype.kind not in "iuf":
        raise ValueError("numbers")
    return places.astype(np.float64)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
