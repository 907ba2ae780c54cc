"""Weather sources with documented units, recognised by their column names."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from warp_torchrl.system.delimited import to_number

_CODES = frozenset(
    "ffmc hffmc finefuelmoisturecode dmc duffmoisturecode dc droughtcode bui buildupindex fwi isi".split()
)
_COLD_IN_F = 50.0
"""Temperatures [F] that no day of a fire stays below: as numbers, those of a summer in Celsius."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """The program that wrote a file, and its units.

    Attributes:
        title: Its name.
        needs: Names of columns that it always has; of some separated by a stroke, one.
        units: Unit by quantity.
        height: Height of its wind, ``10m`` or ``20ft``.
        names: Quantity by a plain name that is no word elsewhere.
        zone: Hours that its clock is ahead of UTC, if its documents say so.
        excludes: Names that it never has.
        is_warm: Whether temperatures must be those of a day of fire in Fahrenheit.
    """

    title: str
    needs: frozenset[str]
    units: dict[str, str]
    height: str = "10m"
    names: dict[str, str] = field(default_factory=dict)
    zone: float | None = None
    excludes: frozenset[str] = field(default_factory=frozenset)
    is_warm: bool = False

    def wrote(self, names: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
        """Return whether a table with these plain names of columns is one of this source's."""
        there = set(names)
        has_all = all(there & set(need.split("|")) for need in self.needs)
        return has_all and not there & self.excludes and not (self.is_warm and _is_cool(names, rows))


def _source(title: str, needs: str, units: str, names: str = "", **options: Any) -> Source:
    return Source(title=title, needs=frozenset(needs.split()), units=_pairs(units), names=_pairs(names), **options)


def _pairs(text: str) -> dict[str, str]:
    return dict(each.split("=") for each in text.split())


_METRIC = "wind_speed=km/h temperature=c rain=mm dew_point=c"
_AMERICAN = "wind_speed=mph temperature=f rain=in dew_point=f"

SOURCES = (
    _source("Burn-P3+", "windspeed winddirection temperature relativehumidity finefuelmoisturecode", _METRIC),
    _source("Canadian", "ws", _METRIC),
    _source(
        "RAWS",
        "year mth day time temp rh windspd|windspeed winddir|winddirection",
        _AMERICAN,
        height="20ft",
        excludes=_CODES,
        is_warm=True,
    ),
    _source("Meteostat", "temp rhum wdir wspd prcp|dwpt|coco", _METRIC, zone=0.0),
    _source(
        "ERA5",
        "u10|10mucomponentofwind v10|10mvcomponentofwind",
        "wind_u=m/s wind_v=m/s temperature=k dew_point=k rain=m",
        zone=0.0,
    ),
    _source("NASA POWER", "ws10m wd10m", "wind_speed=m/s temperature=c rain=mm"),
    _source("NOAA LCD", "hourlywindspeed hourlywinddirection hourlydrybulbtemperature", _AMERICAN),
    _source("Iowa Environmental Mesonet", "sknt drct valid", ""),
    _source("Bureau of Meteorology", "windspdkmh|windspdkt airtemp relhum", _METRIC),
    _source(
        "AEMET OpenData",
        "fint vv dv",
        "wind_speed=m/s temperature=c rain=mm",
        "vv=wind_speed dv=wind_bearing ta=temperature hr=humidity",
        zone=0.0,
    ),
    _source(
        "Météo-France",
        "aaaammjjhh ff dd",
        "wind_speed=m/s temperature=c rain=mm",
        "ff=wind_speed dd=wind_bearing t=temperature u=humidity rr1=rain",
        zone=0.0,
    ),
    _source("Deutscher Wetterdienst", "messdatum f d", "wind_speed=m/s", "f=wind_speed d=wind_bearing", zone=0.0),
)
"""Every source, the first that fits is taken. The Canadian system takes wind in km/h, degrees Celsius, millimetres."""


def find_source(names: Sequence[str], rows: Sequence[Sequence[str]]) -> Source | None:
    """Return the source of a table, from the plain names of its columns and its rows; None if it is not known."""
    return next((each for each in SOURCES if each.wrote(names, rows)), None)


def _is_cool(names: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    place = names.index("temp")
    known = [value for row in rows if (value := to_number(row[place].strip())) is not None and value > -99.0]
    return not known or max(known) <= _COLD_IN_F
