"""Weather from a folder of rasters with a band an hour, on a grid of their own."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.air.fields import Lattice, WeatherFields
from warp_torchrl.world.air.gridded import STRONGEST
from warp_torchrl.world.air.wind import turned
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.terrain.bands import DEGREES, SPEED_UNITS, factor_of
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import RASTERS, Header, read_header, read_layer
from warp_torchrl.world.terrain.resampling import fill, project_bounds, resample
from warp_torchrl.world.weather.table import OPEN_10M_OVER_20FT, WeatherTable, WindHeight, read_weather

TABLE = "weather.csv"
"""Table in the folder, of the same hours: it says when they are, and what no raster does."""
NAMES: Mapping[str, str] = {
    "wind_speed": r"ws|wind_?speed|speed|vel",
    "wind_bearing": r"wd|wind_?dir(ection)?|dir(ection)?|bearing|ang",
    "u": r"u|u10",
    "v": r"v|v10",
    "dead_1h": r"m1|m?dead_?1h?|1h",
    "dead_10h": r"m10|m?dead_?10h?|10h",
    "dead_100h": r"m100|m?dead_?100h?|100h",
    "live_herbaceous": r"mlh|lh|live_herb(aceous)?",
    "live_woody": r"mlw|lw|live_woody",
    "ffmc": r"ffmc",
    "bui": r"bui",
}
"""Ends of the names of files, by what they hold: ``weather_ws.tif``, ``ws.tif``."""
_PERCENT = dict.fromkeys(("%", "percent", "per cent"), 1.0)
_MOST_UNKNOWN = 0.25  # share of the points over a map


class FolderWeather(NamedTuple):
    """Weather of a folder: its hours with their means over the map, and its fields."""

    table: WeatherTable
    fields: WeatherFields


def read_folder(
    folder: Path,
    grid: Grid,
    corner: tuple[int, int] = (0, 0),
    size: tuple[int, int] | None = None,
    *,
    convergence: float = 0.0,
    wind_height: WindHeight | None = None,
    start_ffmc: float = 85.0,
    bui: float | None = None,
    units: Mapping[str, str] | None = None,
) -> FolderWeather:
    """Return the weather of a folder of rasters over a map.

    Files are known by the ends of their names, ``NAMES``; each has a band an hour, or one for all hours. Speed and
    bearing are interpolated as u and v.

    Args:
        folder: The folder.
        grid: The grid that the map is a window of.
        corner: (row, column) of the window.
        size: (rows, columns) of the window; None is the whole grid.
        convergence: Angle from true north, of the bearings, to the grid's north, clockwise [degrees].
        wind_height: Height of the wind; None takes 20ft for miles an hour, else 10m.
        start_ffmc: See ``read_weather``, of the table of the folder.
        bui: The same.
        units: Unit of ``wind_speed`` where its file states none.

    Raises:
        ValueError: If a file is missing, damaged, of other hours or another place, or a unit is not known.
    """
    units, headers = units or {}, _headers(folder)
    table = _table(folder, _count(folder, headers), wind_height, start_ffmc, bui, units)
    hours = _count(folder, headers) if table is None else len(table.hours)
    window = _window(grid, corner, grid.shape if size is None else size)
    points, lattice = _points(headers, window)
    factor, height = _to_metres_a_second(headers, units, wind_height)
    wind = _wind(headers, points, hours, factor, convergence)
    wind *= OPEN_10M_OVER_20FT if height == "20ft" else 1.0
    moisture = torch.full((hours, len(MOISTURES), *points.shape), math.nan)
    for index, name in enumerate(MOISTURES):
        if name in headers:
            factor_of(name, headers[name].path, headers[name].unit, _PERCENT)
            moisture[:, index] = _on(points, name, headers[name], hours)
    fields = WeatherFields(lattice, wind, moisture)
    _tell(headers, height)
    return FolderWeather(_with_means(table, fields, convergence), fields)


def _headers(folder: Path) -> dict[str, Header]:
    """Return the headers of the rasters by what they hold."""
    found: dict[str, Header] = {}
    for path in sorted(each for each in folder.iterdir() if each.suffix.lower() in RASTERS):
        name = next((name for name, ends in NAMES.items() if re.search(rf"(^|[_-])({ends})$", path.stem.lower())), None)
        if name is None:
            continue
        if name in found:
            raise ValueError(f"weather must have one raster of {name}, got {found[name].path.name} and {path.name}")
        found[name] = read_header(name, path, metric=False, band=1)
    if not ({"wind_speed", "wind_bearing"} <= found.keys() or {"u", "v"} <= found.keys()):
        has = ", ".join(each.path.name for each in found.values()) or "none"
        raise ValueError(
            f"weather must have wind in {folder}, as *_ws.tif and *_wd.tif or *_u.tif and *_v.tif, got {has}"
        )
    return found


def _count(folder: Path, headers: Mapping[str, Header]) -> int:
    """Return how many hours the rasters have."""
    counts = {len(each.bands) for each in headers.values()} - {1}
    if len(counts) > 1:
        raise ValueError(f"weather must have rasters of as many bands in {folder}, got {sorted(counts)}")
    return counts.pop() if counts else 1


def _window(grid: Grid, corner: tuple[int, int], size: tuple[int, int]) -> Grid:
    """Return a window of a grid as a grid."""
    (row, column), (a, b, left, d, e, top) = corner, grid.transform[:6]
    place = type(grid.transform)(a, b, left + a * column + b * row, d, e, top + d * column + e * row)
    return Grid(size, grid.crs, place)


def _points(headers: Mapping[str, Header], window: Grid) -> tuple[Grid, Lattice]:
    """Return points over a map, as far apart as the cells of the finest raster."""
    joined = min(max(1, round(_cells_to_one(each.grid, window))) for each in headers.values())
    rows, columns = (max(2, math.ceil(each / joined)) for each in window.shape)
    a, b, left, d, e, top = window.transform[:6]
    place = type(window.transform)(a * joined, b * joined, left, d * joined, e * joined, top)
    middle = (joined - 1) / 2.0
    return Grid((rows, columns), window.crs, place), Lattice((middle, joined), (middle, joined))


def _cells_to_one(grid: Grid, window: Grid) -> float:
    """Return how many of the map's cells lie side by side in one of a raster."""
    west, south, east, north = project_bounds("weather", grid, window.crs)
    across = (east - west) / grid.shape[1] / abs(window.transform[0])
    return min(across, (north - south) / grid.shape[0] / abs(window.transform[4]))


def _to_metres_a_second(
    headers: Mapping[str, Header], units: Mapping[str, str], wind_height: WindHeight | None
) -> tuple[float, WindHeight]:
    """Return the factor of the wind's unit, and its height."""
    header = headers["wind_speed" if "wind_speed" in headers else "u"]
    unit = header.unit or units.get("wind_speed", "")
    if not unit:
        rule = f"must name its unit ({', '.join(('m/s', 'km/h', 'mph', 'kt'))})"
        raise ValueError(f"{header.path.name} {rule}: units.wind_speed=mph, for the file states none")
    factor = factor_of("units.wind_speed", header.path, unit.lower(), SPEED_UNITS)
    is_mph = math.isclose(factor, SPEED_UNITS["mph"])
    return factor, wind_height or ("20ft" if is_mph else "10m")


def _wind(headers: Mapping[str, Header], points: Grid, hours: int, factor: float, convergence: float) -> Tensor:
    """Return u and v at the points, from the grid's north, float32 [T, 2, h, w] [m/s]."""
    first, second = ("wind_speed", "wind_bearing") if "wind_speed" in headers else ("u", "v")
    one, other = headers[first], headers[second]
    if one.grid.differs_in(other.grid):
        raise ValueError(
            f"{second} must be on the grid of {first}, {other.path.name} is not on that of {one.path.name}"
        )
    if second == "wind_bearing":
        factor_of(second, other.path, other.unit, DEGREES)
    made = []
    for hour in range(hours):
        (a, known), (b, also) = (_band(name, each, hour) for name, each in ((first, one), (second, other)))
        a = a * factor
        if second == "v":
            u, v = a, b * factor
        else:
            angle = np.radians(b)
            u, v = -a * np.sin(angle), -a * np.cos(angle)
        _check_strength(one.path, u[known & also], v[known & also])
        made.append([_put(name, each, known & also, one.grid, points) for name, each in (("u", u), ("v", v))])
    return turned(torch.tensor(np.array(made), dtype=torch.float32), torch.deg2rad(torch.tensor([convergence])))


def _check_strength(path: Path, u: np.ndarray, v: np.ndarray) -> None:
    strongest = float(np.hypot(u, v).max(initial=0.0))
    if strongest > STRONGEST:
        raise ValueError(f"wind must be at most {STRONGEST:g} m/s, {path} has {strongest:g}")


def _on(points: Grid, name: str, header: Header, hours: int) -> Tensor:
    """Return a layer's bands at the points, float32 [T, h, w]."""
    made = [_put(name, *_band(name, header, hour), header.grid, points) for hour in range(hours)]
    return torch.tensor(np.array(made), dtype=torch.float32)


def _band(name: str, header: Header, hour: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of an hour and where they are known; of a raster with one band always those."""
    return read_layer(name, header.path, 1 if len(header.bands) == 1 else hour + 1)


def _put(name: str, values: np.ndarray, known: np.ndarray, own: Grid, points: Grid) -> np.ndarray:
    """Return values at the points; beyond the raster's last middles those of the points beside."""
    if own.is_on_earth or points.is_on_earth:
        found, there = resample(name, values, known, own, points, "bilinear")
    elif own.differs_in(points):
        raise ValueError(
            f"{name} must have a CRS, and so must the map, to be interpolated, got {own.crs}, {points.crs}"
        )
    else:
        found, there = values, known
    if there.mean() < 1.0 - _MOST_UNKNOWN:
        raise ValueError(f"{name} must be known over the map, it is in {100.0 * there.mean():.0f} % of it")
    return fill(found, there)


def _tell(headers: Mapping[str, Header], height: WindHeight) -> None:
    """Report the rasters that were read."""
    for name, header in headers.items():
        notes = (f"wind is that at {height}",) if name in ("wind_speed", "u") else ()
        read = {f"{len(header.bands)} bands": name}
        report_file(Provenance(key="weather", file=str(header.path), read=read, notes=notes))


def rasters_of(weather: str | Path) -> list[Path]:
    """Return the rasters that a weather is read from; none of a table."""
    return [each.path for each in _headers(Path(weather)).values()] if Path(weather).is_dir() else []


def times_of(weather: str | Path) -> Path:
    """Return the file that says when the hours of a weather are: of a folder its table."""
    return Path(weather) / TABLE if Path(weather).is_dir() else Path(weather)


def _table(
    folder: Path,
    hours: int,
    wind_height: WindHeight | None,
    start_ffmc: float,
    bui: float | None,
    units: Mapping[str, str],
) -> WeatherTable | None:
    """Return the folder's table, whose rows are the rasters' hours; None where it has none."""
    path = folder / TABLE
    if not path.is_file():
        return None
    table = read_weather(path, wind_height=wind_height, start_ffmc=start_ffmc, bui=bui, units=units)
    if hours not in (1, len(table.hours)):
        raise ValueError(f"{path} must have a row for each of the rasters' {hours} bands, got {len(table.hours)}")
    return table


def _with_means(table: WeatherTable | None, fields: WeatherFields, convergence: float) -> WeatherTable:
    """Return a table of the fields' means over the map, and of the table where they say nothing."""
    winds, moistures = fields.means
    bearing = (torch.rad2deg(torch.atan2(-winds[:, 0], -winds[:, 1])) + convergence) % 360.0
    known = {
        name: column for name, column in zip(MOISTURES, moistures.unbind(1), strict=True) if not column.isnan().any()
    }
    of_wind = {"wind_speed": winds.square().sum(1).sqrt(), "wind_bearing": bearing, "wind_height": "10m"}
    if table is None:
        return WeatherTable(hours=torch.arange(len(winds), dtype=torch.float32), **of_wind, **known)  # type: ignore[arg-type]
    return replace(table, **of_wind, **known)  # type: ignore[arg-type]
