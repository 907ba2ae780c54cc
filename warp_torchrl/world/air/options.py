"""Options by which files of weather are read, whatever their kind."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from warp_torchrl.world.weather.table import WeatherTable, WindHeight, read_weather


@dataclass(frozen=True, kw_only=True)
class WeatherOptions:
    """How a table, a folder of rasters or a netCDF file of weather is read.

    Attributes:
        wind_height: Height of the wind; None takes the file's: 20ft for miles an hour, else 10m.
        units: Unit by quantity, column or variable where the file states none, see ``read_weather``.
        start_ffmc: Fine fuel moisture code an hour before the first row, for a file without FFMC.
        bui: Buildup index, for a file without it.
        asked: ``wind_gust``, ``cloud``: read too, where the file has them.
        convergence: Angle from true north, of the bearings, to the map's grid north, clockwise [degrees]; a table is
            read in true north whatever it is.
    """

    wind_height: WindHeight | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    start_ffmc: float = 85.0
    bui: float | None = None
    asked: Collection[str] = ()
    convergence: float = 0.0

    def table(self, path: str | Path) -> WeatherTable:
        """Return the weather of a table, see ``read_weather``.

        Raises:
            ValueError: See ``read_weather``.
        """
        return read_weather(
            path,
            wind_height=self.wind_height,
            start_ffmc=self.start_ffmc,
            bui=self.bui,
            units=self.units,
            asked=self.asked,
        )
