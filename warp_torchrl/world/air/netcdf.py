"""Weather from a netCDF file: fields by the hour, of reanalyses (ERA5), weather models (HRRR) and CF conventions."""

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.netcdf_grid import Cells, cells_about
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.air.points import PlacedWeather, points_over, put, with_means
from warp_torchrl.world.air.wind import turned
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.weather.clock import dated_clock, hours_until
from warp_torchrl.world.weather.columns import plain_name
from warp_torchrl.world.weather.convergence import grid_convergence
from warp_torchrl.world.weather.dead_moisture import dead_moisture
from warp_torchrl.world.weather.fwi import hourly_ffmc
from warp_torchrl.world.weather.quantities import ASKED, OWNER, QUANTITIES
from warp_torchrl.world.weather.season import saturation_pressure
from warp_torchrl.world.weather.table import OPEN_10M_OVER_20FT, WeatherTable, WindHeight
from warp_torchrl.world.weather.units import unit_of

ENDS = (".nc", ".nc4", ".cdf")
_AS_STATED = WeatherOptions()
_AIR = ("temperature", "humidity", "wet")
"""What ``WeatherFields.air`` holds."""
_TIMES = ("valid_time", "time")
_OF_GRIB = {
    **{"10u": "wind_u", "10v": "wind_v", "si10": "wind_speed", "10si": "wind_speed"},
    **{"wdir10": "wind_bearing", "10wdir": "wind_bearing"},
    **{"2t": "temperature", "2d": "dew_point", "2r": "humidity", "r2": "humidity"},
}
"""Quantities by the short names of GRIB, which are no words."""
_STANDARD = {
    **{"eastward_wind": "wind_u", "northward_wind": "wind_v", "x_wind": "wind_u", "y_wind": "wind_v"},
    **{"wind_speed": "wind_speed", "wind_from_direction": "wind_bearing", "wind_speed_of_gust": "wind_gust"},
    **{"air_temperature": "temperature", "dew_point_temperature": "dew_point", "relative_humidity": "humidity"},
    **{"precipitation_amount": "rain", "lwe_thickness_of_precipitation_amount": "rain", "cloud_area_fraction": "cloud"},
}
"""Quantities by CF standard name, for variables whose own name says nothing."""
_MISSING = 'weather must be read with xarray and netCDF4, which are missing: pip install "warp_torchrl[netcdf]"'


@dataclass(frozen=True, eq=False)
class _Layer:
    """One quantity of a file, in our unit."""

    name: str  # its variable's
    values: np.ndarray  # float64 [T, rows, columns], NaN where it is not known
    from_grid: bool  # whether a wind's components go with the rows and columns


def is_netcdf(path: str | Path) -> bool:
    """Return whether a path ends like a netCDF file."""
    return Path(path).suffix.lower() in ENDS


def read_netcdf(path: Path, window: Grid, options: WeatherOptions = _AS_STATED) -> PlacedWeather:
    """Return the weather of a netCDF file over a map, as ``air.folder.read_folder`` does of a folder.

    Variables are known by their names, as columns of a table, or by their standard names. Dead moistures follow from
    temperature and humidity or dew point in each cell of the file, FFMC too where it has rain. Times are in UTC.

    Args:
        path: The file.
        window: The map.
        options: Of the wind, the units and the fuel's codes.

    Raises:
        ValueError: If xarray is missing, or the file cannot be read, lies elsewhere, or lacks the wind or a unit.
    """
    with _opened(path) as dataset:
        named = _variables(dataset, options.asked)
        cells = cells_about(dataset, next(iter(named.values())), window)
        texts = _times(dataset)
        layers = {name: _layer(name, each, cells, len(texts), options.units) for name, each in named.items()}
    clock = dated_clock(texts, ("time",), None)
    hours = torch.tensor(clock.hours, dtype=torch.float32)
    factor = OPEN_10M_OVER_20FT if options.wind_height == "20ft" else 1.0
    values = {name: torch.from_numpy(each.values).float() for name, each in layers.items()}
    turn = options.convergence - (_convergence(cells.grid) if any(each.from_grid for each in layers.values()) else 0.0)
    known = _completed(values, hours, factor, options.start_ffmc)
    points, lattice = points_over(window, [cells.grid])

    def placed(name: str) -> Tensor:
        each = known[name].double().numpy()
        made = [put(name, hour, ~np.isnan(hour), cells.grid, points) for hour in each]
        return torch.tensor(np.array(made), dtype=torch.float32)

    wind = turned(torch.stack((placed("wind_u"), placed("wind_v")), dim=1), torch.deg2rad(torch.tensor([turn])))
    unknown = torch.full((len(hours), *points.shape), math.nan)
    moisture = torch.stack([placed(name) if name in known else unknown for name in MOISTURES], dim=1)
    air = torch.stack([placed(name) for name in _AIR], dim=1) if "wet" in known else None
    fields = WeatherFields(lattice, wind * factor, moisture, air)
    means = {name: placed(name).mean((1, 2)) for name in ("temperature", "humidity", "rain", *ASKED) if name in known}
    if "wind_gust" in means:
        means["wind_gust"] = means["wind_gust"] * factor
    means |= {} if options.bui is None else {"bui": torch.full_like(hours, options.bui)}
    began = next(iter(clock.moments.values()))[0]
    still = torch.zeros_like(hours)
    table = WeatherTable(hours=hours, wind_speed=still, wind_bearing=still, began=began, zone=0.0, **means)  # type: ignore[arg-type]
    _tell(path, layers, options.wind_height or "10m")
    return PlacedWeather(with_means(table, fields, options.convergence), fields)


def netcdf_minutes(moment: str, path: str | Path, name: str = "start") -> float:
    """Return the minutes from a file's first time to a date and time, in UTC unless it has an offset.

    Raises:
        ValueError: If the file cannot be read, or the moment has another form.
    """
    with _opened(Path(path)) as dataset:
        return 60.0 * hours_until(moment, dated_clock(_times(dataset), ("time",), None), 0.0, name)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Yield the dataset of a file; errors become one line that begins with its path."""
    try:
        import netCDF4  # noqa: F401 - xarray reads with it
        import xarray
    except ImportError:
        raise ValueError(_MISSING) from None
    if not path.is_file():
        raise ValueError(f"weather must be a file that exists, got {path}")
    try:
        with xarray.open_dataset(path, engine="netcdf4", decode_timedelta=False) as dataset:
            yield dataset
    except ValueError as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None
    except (OSError, RuntimeError, KeyError, IndexError, TypeError, OverflowError) as error:  # of damaged files
        raise ValueError(f"{path}: weather must be a netCDF file: {' '.join(str(error).split())}") from None


def _variables(dataset: Any, asked: Collection[str]) -> dict[str, Any]:
    """Return the variables that are read, by quantity; the wind as components, or as speed and bearing."""
    found: dict[str, Any] = {}
    for name, variable in dataset.data_vars.items():
        quantity = _quantity(str(name), variable)
        if quantity is None or variable.ndim < 2 or (quantity in ASKED and quantity not in asked):
            continue
        if quantity in found:
            raise ValueError(f"the file must have one variable of {quantity}, got {found[quantity].name} and {name}")
        found[quantity] = variable
    if {"wind_u", "wind_v"} <= found.keys():
        for name in ("wind_speed", "wind_bearing"):
            found.pop(name, None)
    elif not {"wind_speed", "wind_bearing"} <= found.keys():
        got = ", ".join(map(str, dataset.data_vars)) or "none"
        raise ValueError(f"the file must have wind, as u10 and v10, or speed and direction, got {got}")
    return found


def _quantity(name: str, variable: Any) -> str | None:
    plain = plain_name(name)
    return _OF_GRIB.get(plain) or OWNER.get(plain) or _STANDARD.get(str(variable.attrs.get("standard_name")))


def _times(dataset: Any) -> list[str]:
    """Return the file's times as texts in UTC."""
    for name in _TIMES:
        if name in dataset.variables and np.issubdtype(dataset[name].dtype, np.datetime64) and dataset[name].ndim < 2:
            moments = np.atleast_1d(dataset[name].values).astype("datetime64[s]")
            return [f"{moment}Z" for moment in moments]
    raise ValueError(f"the file must have a coordinate of times, {' or '.join(_TIMES)}, got none")


def _layer(name: str, variable: Any, cells: Cells, count: int, units: Mapping[str, str]) -> _Layer:
    """Return a variable's hours about the map in our unit.

    Raises:
        ValueError: If it has further dimensions, no unit or one that is not known, or a value is out of its range.
    """
    if missing := [each for each in cells.dimensions if each not in variable.dims]:
        raise ValueError(f"{variable.name} must lie on {' and '.join(cells.dimensions)}, it has no {missing[0]}")
    held = variable.isel(dict(zip(cells.dimensions, (cells.rows, cells.columns), strict=True)))
    others = [each for each in held.dims if each not in cells.dimensions]
    values = np.asarray(held.transpose(*others, *cells.dimensions).values, np.float64)
    if values.size != count * values.shape[-2] * values.shape[-1]:
        raise ValueError(f"{variable.name} must have one field for each of {count} times, got {values.shape[:-2]}")
    factor, offset = _conversion(name, variable, units)
    values = values.reshape(count, *values.shape[-2:]) * factor + offset
    quantity = QUANTITIES[name]
    known, slack = values[~np.isnan(values)], 1e-3
    if len(known) and not (quantity.lowest - slack <= known.min() and known.max() <= quantity.highest + slack):
        limits = f"[{quantity.lowest:g}, {quantity.highest:g}] {quantity.unit}".strip()
        raise ValueError(f"{variable.name} must be in {limits}, got {known.min():g} to {known.max():g}")
    of_grid = str(variable.attrs.get("standard_name")) == "x_wind" or variable.attrs.get("GRIB_uvRelativeToGrid") == 1
    return _Layer(str(variable.name), values, bool(of_grid))


def _conversion(name: str, variable: Any, units: Mapping[str, str]) -> tuple[float, float]:
    quantity = QUANTITIES[name]
    said = units.get(name) or units.get(str(variable.name))
    stated = str(variable.attrs.get("units", "")).strip()
    unit = unit_of(stated) or ("fraction" if stated in ("1", "(0 - 1)") and "fraction" in quantity.units else None)
    unit = unit or (unit_of(said) if said else None) or (quantity.usual if not stated else None)
    if unit is None or unit not in quantity.units:
        listed = ", ".join(filter(None, quantity.units))
        raise ValueError(f"{variable.name} must name its unit ({listed}), got {stated or 'none'}: say units.{name}=...")
    return quantity.units[unit]


def _completed(known: dict[str, Tensor], hours: Tensor, factor: float, start_ffmc: float) -> dict[str, Tensor]:
    """Return the values with the wind as components, humidity, dead moistures and FFMC in each cell."""
    if "wind_u" not in known:
        speed, angle = known.pop("wind_speed"), torch.deg2rad(known.pop("wind_bearing"))
        known |= {"wind_u": -speed * angle.sin(), "wind_v": -speed * angle.cos()}
    if "humidity" not in known and {"temperature", "dew_point"} <= known.keys():
        wet, full = (saturation_pressure(known[name]) for name in ("dew_point", "temperature"))
        known["humidity"] = (100.0 * wet / full).clamp(max=100.0)
    if not {"temperature", "humidity"} <= known.keys():
        return known
    air, rain = (known["temperature"], known["humidity"]), known.get("rain")
    falls = torch.zeros_like(air[0]) if rain is None else torch.where(rain.isnan(), rain, (rain > 0.0).float())
    dead = {"wet": falls} | dict(zip(("dead_1h", "dead_10h", "dead_100h"), dead_moisture(*air, rain), strict=True))
    if rain is not None and "ffmc" not in known:
        speed = torch.hypot(known["wind_u"], known["wind_v"]) * factor
        code, codes = torch.full_like(rain[0], start_ffmc), []
        for hour in zip(*air, speed, rain, torch.diff(hours, prepend=hours[:1] - 1), strict=True):
            code = hourly_ffmc(code, *hour)
            codes.append(code)
        known["ffmc"] = torch.stack(codes)
    return dead | known


def _convergence(own: Grid) -> float:
    """Return the angle from true north to the file's grid north at the middle of a map [degrees]; 0 in degrees."""
    if not own.crs.is_projected:
        return 0.0
    west, south, east, north = own.bounds  # of the cells about the map
    return grid_convergence(own.crs.to_wkt(), (west + east) / 2.0, (south + north) / 2.0)


def _tell(path: Path, layers: Mapping[str, _Layer], height: WindHeight) -> None:
    read = {each.name: f"{name}, {QUANTITIES[name].unit}" for name, each in layers.items()}
    notes = (f"wind is that at {height}", "times are in UTC")
    report_file(Provenance(key="weather", file=str(path), read=read, notes=notes))
