"""Weather from a folder of rasters with a band an hour, on a grid of their own."""

import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.gridded import STRONGEST
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.air.points import PlacedWeather, points_over, put, with_means
from warp_torchrl.world.air.wind import turned
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.terrain.bands import DEGREES, SPEED_UNITS, factor_of
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import RASTERS, Header, read_header, read_layer
from warp_torchrl.world.weather.table import OPEN_10M_OVER_20FT, WeatherTable, WindHeight

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
_AS_STATED = WeatherOptions()
_PERCENT = dict.fromkeys(("%", "percent", "per cent"), 1.0)


def read_folder(folder: Path, window: Grid, options: WeatherOptions = _AS_STATED) -> PlacedWeather:
    """Return the weather of a folder of rasters over a map.

    Files are known by the ends of their names, ``NAMES``; each has a band an hour, or one for all hours. Speed and
    bearing are interpolated as u and v.

    Args:
        folder: The folder.
        window: The map.
        options: Of the wind, and of the table of the folder.

    Raises:
        ValueError: If a file is missing, damaged, of other hours or another place, or a unit is not known.
    """
    headers = _headers(folder)
    table = _table(folder, _count(folder, headers), options)
    hours = _count(folder, headers) if table is None else len(table.hours)
    points, lattice = points_over(window, [each.grid for each in headers.values()])
    factor, height = _to_metres_a_second(headers, options.units, options.wind_height)
    wind = _wind(headers, points, hours, factor, options.convergence)
    wind *= OPEN_10M_OVER_20FT if height == "20ft" else 1.0
    moisture = torch.full((hours, len(MOISTURES), *points.shape), math.nan)
    for index, name in enumerate(MOISTURES):
        if name in headers:
            factor_of(name, headers[name].path, headers[name].unit, _PERCENT)
            moisture[:, index] = _on(points, name, headers[name], hours)
    fields = WeatherFields(lattice, wind, moisture)
    _tell(headers, height)
    return PlacedWeather(with_means(table, fields, options.convergence), fields)


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
        made.append([put(name, each, known & also, one.grid, points) for name, each in (("u", u), ("v", v))])
    return turned(torch.tensor(np.array(made), dtype=torch.float32), torch.deg2rad(torch.tensor([convergence])))


def _check_strength(path: Path, u: np.ndarray, v: np.ndarray) -> None:
    strongest = float(np.hypot(u, v).max(initial=0.0))
    if strongest > STRONGEST:
        raise ValueError(f"wind must be at most {STRONGEST:g} m/s, {path} has {strongest:g}")


def _on(points: Grid, name: str, header: Header, hours: int) -> Tensor:
    """Return a layer's bands at the points, float32 [T, h, w]."""
    made = [put(name, *_band(name, header, hour), header.grid, points) for hour in range(hours)]
    return torch.tensor(np.array(made), dtype=torch.float32)


def _band(name: str, header: Header, hour: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of an hour and where they are known; of a raster with one band always those."""
    return read_layer(name, header.path, 1 if len(header.bands) == 1 else hour + 1)


def _tell(headers: Mapping[str, Header], height: WindHeight) -> None:
    """Report the rasters that were read."""
    for name, header in headers.items():
        notes = (f"wind is that at {height}",) if name in ("wind_speed", "u") else ()
        read = {f"{len(header.bands)} bands": name}
        report_file(Provenance(key="weather", file=str(header.path), read=read, notes=notes))


def rasters_of(weather: str | Path) -> list[Path]:
    """Return the rasters that a weather is read from; none of a table."""
    return [each.path for each in _headers(Path(weather)).values()] if Path(weather).is_dir() else []


def _table(folder: Path, hours: int, options: WeatherOptions) -> WeatherTable | None:
    """Return the folder's table, whose rows are the rasters' hours; None where it has none."""
    path = folder / TABLE
    if not path.is_file():
        return None
    table = options.table(path)
    if hours not in (1, len(table.hours)):
        raise ValueError(f"{path} must have a row for each of the rasters' {hours} bands, got {len(table.hours)}")
    return table
