"""Places of the cells of a netCDF file: longitudes and latitudes, or metres of a CF grid mapping."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from warp_torchrl.world.terrain.crs import WGS84, project, stated_crs
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.resampling import project_bounds

_MARGIN = 2  # cells about the map that are read
_EVEN = 0.05  # of a step by which cells may lie off
_METRES = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "km": 1000.0}
_NAMES = {
    "y": ("projection_y_coordinate", "y", "northing", "south_north"),
    "x": ("projection_x_coordinate", "x", "easting", "west_east"),
    "latitude": ("latitude", "lat", "xlat", "nav_lat"),
    "longitude": ("longitude", "lon", "long", "xlong", "nav_lon"),
}
_RADIUS = 6_371_229.0
"""Of the Earth in weather models' GRIB files, where a file states none [m]."""
_PROJECTIONS = {
    "lambert_conformal_conic": "Lambert_Conformal_Conic_2SP",
    "albers_conical_equal_area": "Albers_Conic_Equal_Area",
    "transverse_mercator": "Transverse_Mercator",
    "polar_stereographic": "Polar_Stereographic",
}


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of a file about a map, rows from north to south and columns from west to east.

    Attributes:
        dimensions: Names of the dimensions of rows and columns.
        rows: Places of the rows in the file.
        columns: The same of columns.
        grid: Where they lie.
    """

    dimensions: tuple[str, str]
    rows: np.ndarray
    columns: np.ndarray
    grid: Grid


def cells_about(dataset: Any, variable: Any, window: Grid) -> Cells:
    """Return the cells of a variable about a map.

    Args:
        dataset: An ``xarray.Dataset``.
        variable: One of its variables.
        window: The map.

    Raises:
        ValueError: If nothing says where they lie, they are not even, or the map lies elsewhere.
    """
    if not window.is_on_earth:
        raise ValueError("the map must have a CRS, so that weather of a netCDF file finds it, got none")
    (rows, columns), (y, x), crs = _axes(dataset, variable)
    if crs.is_geographic:
        x = np.where(x > 180.0, x - 360.0, x)
    down, right = np.argsort(-y), np.argsort(x)
    y, x = y[down], x[right]
    west, south, east, north = project_bounds("weather", window, crs)
    inside = [_about(-y, -north, -south), _about(x, west, east)]
    (down, y), (right, x) = (down[inside[0]], y[inside[0]]), (right[inside[1]], x[inside[1]])
    step_y, step_x = _step("rows", -y), _step("columns", x)
    place = type(window.transform)(step_x, 0.0, x[0] - step_x / 2.0, 0.0, -step_y, y[0] + step_y / 2.0)
    return Cells((rows, columns), down, right, Grid((len(y), len(x)), crs, place))


def _about(rising: np.ndarray, low: float, high: float) -> slice:
    """Return the places of rising coordinates from some cells before a stretch to some behind it."""
    first, last = np.searchsorted(rising, [low, high])
    if not (math.isfinite(low) and math.isfinite(high)) or last == 0 or first == len(rising):
        raise ValueError("the file must cover the map, it lies elsewhere")
    return slice(max(0, int(first) - _MARGIN), int(last) + _MARGIN)


def _step(what: str, rising: np.ndarray) -> float:
    steps = np.diff(rising)
    if not len(steps) or np.ptp(steps) > _EVEN * steps.mean():
        raise ValueError(f"the file must have two {what} about the map at least, evenly apart, got {len(rising)}")
    return float(steps.mean())


def _axes(dataset: Any, variable: Any) -> tuple[tuple[str, str], tuple[np.ndarray, np.ndarray], Any]:
    """Return the dimensions of rows and columns, their coordinates, and the CRS of these."""
    found = {kind: _coordinate(dataset, kind) for kind in _NAMES}
    mapping = _mapping(dataset, variable)
    y, x, latitude, longitude = (found[kind] for kind in ("y", "x", "latitude", "longitude"))
    if y is not None and x is not None and mapping is not None:
        places = y.values.astype(np.float64) * _metres(y), x.values.astype(np.float64) * _metres(x)
        return (y.dims[0], x.dims[0]), places, mapping
    if latitude is None or longitude is None:
        got = ", ".join(map(str, dataset.coords)) or "none"
        raise ValueError(f"the file must have latitude and longitude, or x and y with a grid mapping, got {got}")
    if latitude.ndim == longitude.ndim == 1:
        places = latitude.values.astype(np.float64), longitude.values.astype(np.float64)
        return (latitude.dims[0], longitude.dims[0]), places, stated_crs("weather", WGS84)
    return _of_planes(latitude, longitude, mapping)


def _of_planes(
    latitude: Any, longitude: Any, mapping: Any
) -> tuple[tuple[str, str], tuple[np.ndarray, np.ndarray], Any]:
    """Return the axes of latitudes and longitudes by cell, [rows, columns], in the CRS of their mapping."""
    if latitude.ndim != 2 or mapping is None:
        raise ValueError("the file must have a grid mapping where latitudes and longitudes are by cell, got none")
    x, y = project("weather", longitude.values.ravel(), latitude.values.ravel(), stated_crs("weather", WGS84), mapping)
    x, y = x.reshape(latitude.shape), y.reshape(latitude.shape)
    if np.ptp(x, axis=0).max() > abs(x[0, 1] - x[0, 0]) or np.ptp(y, axis=1).max() > abs(y[1, 0] - y[0, 0]):
        raise ValueError("the file must have cells in rows and columns of its grid mapping, they lie off")
    return (latitude.dims[0], latitude.dims[1]), (y.mean(axis=1), x.mean(axis=0)), mapping


def _coordinate(dataset: Any, kind: str) -> Any:
    """Return the variable of a coordinate by its standard name, else by its name; None without one."""
    named = [each for name, each in dataset.variables.items() if _is_named(str(name), each, kind) and each.ndim]
    return named[0] if named else None


def _is_named(name: str, variable: Any, kind: str) -> bool:
    standard = variable.attrs.get("standard_name")
    return standard == _NAMES[kind][0] or (standard is None and name.lower() in _NAMES[kind])


def _metres(coordinate: Any) -> float:
    unit = str(coordinate.attrs.get("units", "m")).lower()
    if unit not in _METRES:
        raise ValueError(f"coordinates of the file must be in m or km, got {unit}")
    return _METRES[unit]


def _mapping(dataset: Any, variable: Any) -> Any:
    """Return the CRS of a variable's grid mapping; None without one that is projected."""
    name = variable.attrs.get("grid_mapping") or variable.encoding.get("grid_mapping")
    others = [each for each, held in dataset.variables.items() if "grid_mapping_name" in held.attrs]
    name = str(name).split(":")[0] if name in dataset.variables else next(iter(others), None)
    if name is None:
        return None
    told = dataset.variables[name].attrs
    text = told.get("crs_wkt") or told.get("spatial_ref")
    kind = told.get("grid_mapping_name")
    if kind == "latitude_longitude" and not text:
        return None
    crs = stated_crs("weather", str(text) if text else _wkt(kind, told))
    return crs if crs.is_projected else None


def _wkt(kind: Any, told: Mapping[str, Any]) -> str:
    """Return the WKT of a CF grid mapping (CF Conventions, appendix F)."""
    if kind not in _PROJECTIONS:
        raise ValueError(f"the grid mapping must be one of {', '.join(_PROJECTIONS)} or have crs_wkt, got {kind}")

    def number(name: str, usual: float) -> float:
        return float(np.ravel(told.get(name, usual))[0])

    radius = number("semi_major_axis", number("earth_radius", _RADIUS))
    flat = number("inverse_flattening", 0.0)
    parallels = [float(each) for each in np.ravel(told.get("standard_parallel", []))]
    central = number("longitude_of_central_meridian", number("straight_vertical_longitude_from_pole", 0.0))
    origin = number("latitude_of_projection_origin", 0.0)
    named = {"central_meridian": central, "latitude_of_origin": origin}
    if kind == "polar_stereographic":
        named["latitude_of_origin"] = parallels[0] if parallels else origin
    elif parallels:
        named |= {"standard_parallel_1": parallels[0], "standard_parallel_2": parallels[-1]}
    else:
        named["scale_factor"] = number("scale_factor_at_central_meridian", 1.0)
    named |= {name: number(name, 0.0) for name in ("false_easting", "false_northing")}
    listed = ",".join(f'PARAMETER["{name}",{value:.12g}]' for name, value in named.items())
    globe = f'GEOGCS["weather",DATUM["weather",SPHEROID["weather",{radius:.12g},{flat:.12g}]],PRIMEM["Greenwich",0],'
    globe += 'UNIT["degree",0.0174532925199433]]'
    return f'PROJCS["weather",{globe},PROJECTION["{_PROJECTIONS[kind]}"],{listed},UNIT["metre",1]]'
