"""Case of a prediction: one map, the place and time of ignition, and the weather."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.prediction.files import MapPlace
from warp_torchrl.runs.config.options import PredictionOptions
from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.folder import rasters_of, read_folder, times_of
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ignition.file import read_ignition, read_ignition_times
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.barriers import read_barriers
from warp_torchrl.world.terrain.geotiff import local_grid
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.terrain.source import LandscapeSource
from warp_torchrl.world.weather.convergence import grid_convergence
from warp_torchrl.world.weather.table import WeatherTable, minutes_until, read_weather

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
    weather, by_place = _weather(options, place, (height, width), convergence)
    start, lit, later = _started(options, place.grid, lit)
    closed = None
    if options.barriers is not None:
        closed = torch.as_tensor(read_barriers(options.barriers, place.grid, options.barrier_width))[rows, columns]
        ground = replace(ground, age=ground.age * ~closed)  # nothing grows there
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
    )


def _started(options: PredictionOptions, grid: Grid, lit: Tensor) -> tuple[float, Tensor, Tensor | None]:
    """Return the start [minutes after the weather's first row], what burns then, and when more is lit since then."""
    weather = times_of(str(options.weather))

    def moment(text: str, name: str = "the time of an ignition") -> float:
        return minutes_until(text, weather, options.units, name)

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


def _weather(
    options: PredictionOptions, place: MapPlace, size: tuple[int, int], convergence: float
) -> tuple[WeatherTable, WeatherFields | None]:
    """Return the weather by the hour, and by place where it is a folder of rasters."""
    path = Path(str(options.weather))
    how: dict[str, Any] = {
        "wind_height": options.wind_height,
        "start_ffmc": options.start_ffmc,
        "bui": options.bui,
        "units": options.units,
    }
    if not path.is_dir():
        return read_weather(str(options.weather), **how), None
    return read_folder(path, place.grid, place.corner, size, convergence=convergence, **how)


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
