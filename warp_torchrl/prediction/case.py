"""Case of a prediction: one map, the place and time of ignition, and the weather."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.prediction.files import MapPlace
from warp_torchrl.prediction.season import Season
from warp_torchrl.runs.config.options import PredictionOptions
from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.files import minutes_in, read_any
from warp_torchrl.world.air.folder import rasters_of
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.air.points import window_of
from warp_torchrl.world.air.sunlight import Sunlight, Sunlit, by_sunlight
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ignition.file import read_ignition, read_ignition_times
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.barriers import read_barriers
from warp_torchrl.world.terrain.crs import WGS84, project, stated_crs
from warp_torchrl.world.terrain.geotiff import local_grid
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.terrain.source import LandscapeSource
from warp_torchrl.world.weather.convergence import grid_convergence
from warp_torchrl.world.weather.table import WeatherTable

_MINUTE = 1e-3  # by which two times may be off for rounding [minutes]
_NEAR = 0.005  # share by which a cell's side may be off


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Inputs of ``predict``, read and checked."""

    ground: Landscape  # batch size [1]
    place: MapPlace
    cell_size: float  # [m]
    fire: RateFire
    weather: WeatherTable
    start: float  # since the weather's first row began [minutes]
    convergence: float  # angle from true north to grid north [degrees]
    ignition: Tensor  # what burns at the start, bool [H, W]
    later: Tensor | None = None  # when further cells are lit since the start [minutes], float32 [H, W], else infinite
    closed: Tensor | None = None  # cells of barriers, bool [H, W]
    fields: WeatherFields | None = None  # the weather by place
    files: Sequence[str] = ()  # what is read of each file of the map, and what is left
    sunlight: Sequence[Sunlight] | None = None  # how dead fuel differs by aspect, slope and shade, row by row
    season: str | None = None  # what the date tells of live fuel


def read_case(source: LandscapeSource, fire: RateFire, options: PredictionOptions) -> Case:
    """Read what the options name, for a landscape's one map.

    Raises:
        ValueError: If a file cannot be read or does not fit.
    """
    ground = source(world_key(torch.tensor([options.seed])))
    fire = fire.on(source)
    cell_size: float = getattr(source, "cell_size", 30.0) if options.cell_size is None else options.cell_size
    height, width = ground.cover.shape[1:]
    grid = getattr(source, "grid", None)
    _check_cell_size(options.cell_size, grid)
    corner = (0, 0) if grid is None or ground.corner is None else tuple(ground.corner[0].tolist())
    place = MapPlace(grid or local_grid((height, width), cell_size), (corner[0], corner[1]))
    lit = torch.as_tensor(read_ignition(str(options.ignition), place.grid))
    rows, columns = slice(corner[0], corner[0] + height), slice(corner[1], corner[1] + width)
    convergence = _convergence(place, (height, width)) if options.true_north else 0.0
    weather, by_place = _weather(options, window_of(place.grid, place.corner, (height, width)), convergence)
    if options.gusts:
        options.gustiness.check(weather)
    start, lit, later = _started(options, place.grid, lit)
    closed = None
    if options.barriers is not None:
        closed = torch.as_tensor(read_barriers(options.barriers, place.grid, options.barrier_width))[rows, columns]
        ground = replace(ground, age=ground.age * ~closed)  # nothing grows there
    told, sunlight = None, None
    middle = _middle(place, (height, width))
    if options.moisture == "fosberg":
        weather, by_place, sunlight = _sunlit(weather, fire, by_place, middle)
    if options.season == "date":
        fire, weather, told = _season(ground, middle, start)(fire, weather)
    return Case(
        ground=options.hills.shaped(ground, cell_size) if options.wind == "terrain" else ground,
        place=place,
        cell_size=cell_size,
        fire=fire,
        weather=weather,
        start=start,
        convergence=convergence,
        ignition=lit[rows, columns],
        later=None if later is None else later[rows, columns],
        closed=closed,
        files=_files(source, str(options.ignition), *rasters_of(str(options.weather))),
        fields=by_place,
        sunlight=sunlight,
        season=told,
    )


def _started(options: PredictionOptions, grid: Grid, lit: Tensor) -> tuple[float, Tensor, Tensor | None]:
    """Return the start [minutes after the weather's first row], what burns then, and when more is lit since then."""

    def moment(text: str, name: str = "the time of an ignition") -> float:
        return minutes_in(str(options.weather), text, options.units, name)

    start = moment(options.start, "start") if isinstance(options.start, str) else options.start
    found = read_ignition_times(str(options.ignition), grid, moment)
    if found is None:
        return start or 0.0, lit, None
    if options.observed is not None:
        raise ValueError("ignition must have no times where observed is given, which tells what had burned by then")
    times = torch.as_tensor(found)
    earliest = round(float(times.min()), 3)
    if earliest < 0.0:
        raise ValueError(f"ignition must not be before the weather's first row, got {-earliest:g} minutes before it")
    start = earliest if start is None else start
    if start > earliest + _MINUTE:
        first = f"the earliest ignition, {earliest:g} minutes after the weather's first row"
        raise ValueError(f"start must not be after {first}, got {start:g}; null starts with it")
    since = times - start
    return start, since <= _MINUTE, torch.where(since > _MINUTE, since, torch.inf)


def _weather(options: PredictionOptions, window: Grid, convergence: float) -> tuple[WeatherTable, WeatherFields | None]:
    """Return the weather by the hour, and by place where it is a folder of rasters or a netCDF file."""
    how = WeatherOptions(
        wind_height=options.wind_height,
        units=options.units,
        start_ffmc=options.start_ffmc,
        bui=options.bui,
        asked=(*["wind_gust"] * options.gusts, *["cloud"] * (options.moisture == "fosberg")),
        convergence=convergence,
    )
    return read_any(str(options.weather), window, how)


def _sunlit(
    weather: WeatherTable, fire: RateFire, fields: WeatherFields | None, middle: tuple[float, float] | None
) -> Sunlit:
    """Return the weather with the dead moistures of level ground, and how they differ by place."""
    if fire.bed.table is None:
        raise ValueError("moisture=fosberg is read by Rothermel's fuels, fbfm13 and fbfm40, got fire.model=fbp")
    latitude, longitude = middle or (0.0, None)
    return by_sunlight(weather, fields, longitude, in_south=latitude < 0.0)


def _season(ground: Landscape, middle: tuple[float, float] | None, start: float) -> Season:
    if middle is None:
        raise ValueError("season=date needs a map with a CRS, to know its latitude, got none")
    elevation = None if ground.elevation is None else float(ground.elevation.mean())
    return Season(latitude=middle[0], longitude=middle[1], elevation=elevation, start=start)


def _middle(place: MapPlace, size: tuple[int, int]) -> tuple[float, float] | None:
    """Return latitude and longitude of the middle of a map [degrees]; None where it has no place on Earth."""
    if not place.grid.is_on_earth:
        return None
    west, south, east, north = window_of(place.grid, place.corner, size).bounds
    to = stated_crs("landscape", WGS84)
    x, y = (np.array([(low + high) / 2.0]) for low, high in ((west, east), (south, north)))
    longitude, latitude = project("landscape", x, y, place.grid.crs, to)
    return float(latitude[0]), float(longitude[0])


def _files(source: LandscapeSource, *others: str | Path) -> list[str]:
    """Return a line for each file of the map, and one for those beside it that nobody reads, for the map or others."""
    left = source.unread(*others) if isinstance(source, Raster) else []
    return [*getattr(source, "files", ()), *([f"files that are not read: {', '.join(left)}"] if left else [])]


def _check_cell_size(given: float | None, grid: Grid | None) -> None:
    """Refuse a side of a cell that is not that of a map with a place on Earth."""
    if given is None or grid is None or not grid.is_on_earth or not grid.is_placed:
        return
    if abs(given / grid.cell_size - 1.0) > _NEAR:
        raise ValueError(f"cell_size must be that of the landscape, {grid.cell_size:g} m, or null, got {given:g}")


def whole_map(source: Raster) -> Raster:
    """Return a raster whose one window is its whole grid."""
    return replace(source, size=source.extent, row=0, column=0)


def _convergence(place: MapPlace, size: tuple[int, int]) -> float:
    """Return the angle from true north to grid north at the middle of a map; 0 where it has no place on Earth."""
    grid: Any = place.grid
    if not grid.is_on_earth:
        return 0.0
    row, column = place.corner[0] + size[0] / 2.0, place.corner[1] + size[1] / 2.0
    a, b, left, d, e, top = grid.transform[:6]
    return grid_convergence(grid.crs.to_wkt(), left + a * column + b * row, top + d * column + e * row)
