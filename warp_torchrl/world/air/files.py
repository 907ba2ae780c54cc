"""Weather of any kind of file: a table, a folder of rasters, a netCDF file."""

from collections.abc import Mapping
from pathlib import Path

from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.folder import TABLE, read_folder
from warp_torchrl.world.air.netcdf import is_netcdf, netcdf_minutes, read_netcdf
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.weather.table import WeatherTable, minutes_until


def read_any(weather: str, window: Grid, options: WeatherOptions) -> tuple[WeatherTable, WeatherFields | None]:
    """Return the weather by the hour, and by place where it is a folder of rasters or a netCDF file.

    Args:
        weather: The file or folder, or ``august``.
        window: The map.
        options: How it is read.

    Raises:
        ValueError: If it cannot be read or does not fit.
    """
    path = Path(weather)
    if path.is_dir():
        return read_folder(path, window, options)
    return read_netcdf(path, window, options) if is_netcdf(path) else (options.table(weather), None)


def minutes_in(
    weather: str, moment: str, units: Mapping[str, str], name: str = "start", zone: float | None = None
) -> float:
    """Return the minutes from the first hour of a weather to a date and time; a folder has its hours in a table.

    The arguments are those of ``read_any`` and of ``minutes_until``.

    Raises:
        ValueError: If it has no times, or the moment has another form.
    """
    if is_netcdf(weather) and not Path(weather).is_dir():
        return netcdf_minutes(moment, weather, name)
    return minutes_until(moment, Path(weather) / TABLE if Path(weather).is_dir() else weather, units, name, zone)
