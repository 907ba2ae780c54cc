"""Coordinate reference systems: accepted notations, and the true size of their cells."""

import math
import re
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.gdal import reading

WGS84 = "EPSG:4326"
_CODE = re.compile(
    r"(?:urn:(?:x-)?ogc:def:crs:)?(?P<authority>EPSG|ESRI|OGC):(?P<version>[\d.]{0,10}:)?(?P<code>\d{1,7}|CRS(?:84|83|27)h?)",
    re.IGNORECASE,
)
_OF_OGC = {"CRS84": 4326, "CRS83": 4269, "CRS27": 4267}  # in longitude and latitude, as GeoJSON has all of them
_KINDS = (
    "PROJCS|GEOGCS|COMPD_CS|LOCAL_CS|PROJCRS|PROJECTEDCRS|GEOGCRS|GEOGRAPHICCRS|GEODCRS|GEODETICCRS|COMPOUNDCRS|ENGCRS"
)
_WKT = re.compile(rf'\s*(?:{_KINDS})\s*\[(?:[\w\s,+.\-\[\]()]|"[^"\x00-\x1f]*")*\]\s*', re.IGNORECASE)
_FILES = re.compile(r"grids\s*=(?!\s*@null\b)|_GRIDS|PARAMETERFILE|\+init|/vsi|://", re.IGNORECASE)
_LONGEST, _DEEPEST = 10_000, 20  # characters and brackets of a WKT
_SQUARE = 1.05
"""Longest side over the shortest of cells that count as squares: 1.025 at worst in the conterminous US in EPSG:5070."""
_NEAR = 0.005
"""Difference of sides on the map and on the ground that is let pass: 1 % of an area; within a UTM zone it is 0.1 %."""
_EQUATOR, _ECCENTRICITY = 6_378_137.0, 0.00669437999014  # radius [m] and its square, of WGS84
_STEP = 50.0  # half the length that is measured on the ground [m]; of larger cells half a cell


class GroundCells(NamedTuple):
    """Cells of a map, measured on the ground."""

    side: float  # of the middle one, the root of its area [m]
    ratio: float  # longest side over the shortest of one cell
    change: float  # largest difference of sides over the map, as a share of ``side``


def stated_crs(name: str, stated: object) -> Any:
    """Return the CRS that a file states: an EPSG or ESRI code, an OGC urn or WKT, and nothing that names a file.

    Args:
        name: What the file is, for messages.
        stated: A text, or a whole number that is an EPSG code.

    Raises:
        ValueError: If it is none of these, or PROJ does not know it.
    """
    text = f"EPSG:{stated}" if type(stated) is int else stated
    if not isinstance(text, str):
        raise ValueError(f"{name} must state its CRS as a text, got {type(stated).__name__}")
    shown = f"{text.strip()[:60]!r}"
    with reading(f"{name} must have a CRS that is known, got {shown}") as rasterio:
        named = _CODE.fullmatch(text.strip())
        if named:
            return _of_code(name, named, rasterio.crs.CRS)
        if not _is_wkt(text):
            rule = "a CRS that is known, an EPSG code (EPSG:32610), an OGC urn or WKT"
            raise ValueError(f"{name} must have {rule}, got {shown}")
        return check_crs(name, rasterio.crs.CRS.from_wkt(text, morph_from_esri_dialect=False))


def _of_code(name: str, named: re.Match[str], crs: Any) -> Any:
    authority, code = named["authority"].upper(), named["code"].upper()
    if (authority == "OGC") == code.isdigit():
        raise ValueError(f"{name} must have a CRS that is known, got {named[0]!r}")
    if authority == "ESRI":
        return crs.from_authority("ESRI", code)
    return crs.from_epsg(_OF_OGC[code.removesuffix("H")] if authority == "OGC" else int(code))


def _is_wkt(text: str) -> bool:
    """Return whether a text is WKT of a modest size that names no file."""
    if len(text) > _LONGEST or not _WKT.fullmatch(text) or _FILES.search(text):
        return False
    depth = np.cumsum([(each == "[") - (each == "]") for each in re.sub(r'"[^"]*"', "", text)])
    return bool(depth.max() <= _DEEPEST and depth.min() >= 0 and depth[-1] == 0)


def check_crs(name: str, crs: Any) -> Any:
    """Return a raster's CRS, None for none.

    Raises:
        ValueError: If it names a file, such as a grid of shifts.
    """
    if crs and _FILES.search(crs.to_wkt()):
        raise ValueError(f"{name} must have a CRS that names no file, got {crs.to_wkt()[:60]!r}")
    return crs or None


def project(name: str, x: np.ndarray, y: np.ndarray, crs: Any, to: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates of a CRS in another, float64 [n] each; infinite where they are none there.

    Raises:
        ValueError: If no way leads there.
    """
    with reading(f"{name} must have a CRS that leads to {to}, got {crs}"):
        from rasterio.warp import transform

        east, north = transform(crs, to, x, y)
    return np.asarray(east, np.float64), np.asarray(north, np.float64)


@cache
def ground_cells(crs: Any, transform: Any, shape: tuple[int, int]) -> GroundCells:
    """Return the cells of a projected map on the ground: in its middle, its corners and the middles of its edges.

    Args:
        crs: A projected CRS.
        transform: From (column, row) to coordinates.
        shape: (rows, columns).

    Raises:
        ValueError: If PROJ knows no way to the ground.
    """
    reach = max(0.5, _STEP / (abs(transform[0]) * crs.linear_units_factor[1]))
    rows, columns = (np.array([0.0, 0.5, 1.0]) * side for side in shape)
    row, column = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
    east, south = (_on_ground(crs, transform, column, row, *way) / (2.0 * reach) for way in ((reach, 0), (0, reach)))
    lengths = np.stack([np.hypot(*east), np.hypot(*south)])
    side = np.sqrt(np.abs(east[0] * south[1] - east[1] * south[0]))
    ratio, middle = float((lengths.max(0) / lengths.min(0)).max()), float(side[4])
    return GroundCells(middle, ratio, float(np.abs(side / middle - 1.0).max()))


def _on_ground(crs: Any, transform: Any, column: np.ndarray, row: np.ndarray, across: float, down: float) -> np.ndarray:
    """Return distances on the ground, [east, north] x places [m], between points on both sides of a place."""
    ends = []
    for sign in (-1.0, 1.0):
        at, below = column + sign * across, row + sign * down
        x, y = (transform[each] * at + transform[each + 1] * below + transform[each + 2] for each in (0, 3))
        ends.append(np.radians(project("the map", x, y, crs, WGS84)))
    (west, south), (east, north) = ends
    latitude = (south + north) / 2.0
    root = np.sqrt(1.0 - _ECCENTRICITY * np.sin(latitude) ** 2)
    turn = (east - west + math.pi) % (2.0 * math.pi) - math.pi
    metres = _EQUATOR / root * np.cos(latitude) * turn, _EQUATOR * (1.0 - _ECCENTRICITY) / root**3 * (north - south)
    return np.stack(metres)


def distortion(cells: GroundCells, side: float) -> str:
    """Return in words why cells differ on the ground from the map; empty if they do not.

    Args:
        cells: On the ground.
        side: On the map [m].
    """
    if not cells.ratio <= _SQUARE:
        return f"cells whose sides differ by {100.0 * (cells.ratio - 1.0):.3g} % there"
    if not abs(cells.side / side - 1.0) <= _NEAR:
        return f"cells of {cells.side:.4g} m there, and {side:.4g} m on the map"
    if not cells.change <= _NEAR:
        return f"cells whose sides change by {100.0 * cells.change:.3g} % over the map there"
    return ""
