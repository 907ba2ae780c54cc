"""Hourly weather: a table read from a CSV file, with fuel moistures computed from it."""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal, cast

import torch
from torch import Tensor

from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.weather.cells import bearings, column_values
from warp_torchrl.world.weather.clock import Clock, hours_until
from warp_torchrl.world.weather.columns import Column, find_columns, plain_name, stated_height
from warp_torchrl.world.weather.dead_moisture import dead_moisture
from warp_torchrl.world.weather.fwi import buildup_index, hourly_ffmc
from warp_torchrl.world.weather.layout import Sheet, read_sheet, zone_of
from warp_torchrl.world.weather.reanalysis import humidity_of, wind_of
from warp_torchrl.world.weather.sources import Source
from warp_torchrl.world.weather.times import read_clock

WindHeight = Literal["10m", "20ft"]
"""At what height over open ground wind was measured: by the Canadian and international custom, or the American."""
_EXAMPLES = Path(__file__).parent / "examples"
OPEN_10M_OVER_20FT = 1.15
"""Wind at 10 m over that at 20 ft in the open (Turner and Lawson 1978, BC-X-177)."""
_log = logging.getLogger("warp_torchrl")


@dataclass(frozen=True, kw_only=True)
class WeatherValues:
    """The weather of some moments; every tensor float32 of one shape, None where it is not known."""

    wind_speed: Tensor  # at wind_height in the open [m/s]
    wind_bearing: Tensor  # where it comes from [degrees clockwise from true north]
    temperature: Tensor | None = None  # [C]
    humidity: Tensor | None = None  # [per cent]
    rain: Tensor | None = None  # [mm] in the row's time
    ffmc: Tensor | None = None  # fine fuel moisture code, 0..101
    dmc: Tensor | None = None  # duff moisture code
    dc: Tensor | None = None  # drought code
    bui: Tensor | None = None  # buildup index
    dead_1h: Tensor | None = None  # moisture of dead fuel of 1 hour [per cent]
    dead_10h: Tensor | None = None  # [per cent]
    dead_100h: Tensor | None = None  # [per cent]
    live_herbaceous: Tensor | None = None  # [per cent]
    live_woody: Tensor | None = None  # [per cent]
    wind_gust: Tensor | None = None  # at wind_height [m/s]; NaN in a row without one
    cloud: Tensor | None = None  # sky that clouds cover [per cent]; NaN in a row without one
    wind_height: WindHeight = "10m"


@dataclass(frozen=True, kw_only=True)
class WeatherTable(WeatherValues):
    """Weather row by row; every tensor float32 [T]. A row holds until the next begins, the last one from then on."""

    hours: Tensor  # since the first row began, growing
    began: float | None = None  # hours from 1970 to the first row on the rows' clock; None without a date
    zone: float | None = None  # hours that this clock is ahead of UTC; None where nothing says it

    def at(self, minutes: Tensor | float) -> WeatherValues:
        """Return the weather at some minutes since the first row began, in their shape; before, the first row holds."""
        moments = torch.as_tensor(minutes, dtype=torch.float32, device=self.hours.device) / 60
        row = (torch.searchsorted(self.hours, moments.contiguous(), right=True) - 1).clamp(min=0)
        known = {each.name: getattr(self, each.name) for each in fields(WeatherValues)}
        values = {name: value[row] for name, value in known.items() if isinstance(value, Tensor)}
        return WeatherValues(wind_height=self.wind_height, **values)


def read_weather(
    path: str | Path,
    *,
    wind_height: WindHeight | None = None,
    start_ffmc: float = 85.0,
    bui: float | None = None,
    units: Mapping[str, str] | None = None,
    asked: Collection[str] = (),
) -> WeatherTable:
    """Return the weather of a file, one row per hour or at the rows' times.

    Names and units of columns: `world.weather.columns`; times: `world.weather.times`; kinds of files:
    `world.weather.layout`. Missing quantities are computed where possible: FFMC by the hour from temperature, humidity,
    wind and rain; BUI from DMC and DC; humidity from the dew point; dead moistures from temperature and humidity. A
    line of the log lists the columns that were read and ignored.

    Args:
        path: The file; or the name of one that comes with the package: ``august``, three hot dry days, made up.
        wind_height: Height at which the wind was measured; None takes the file's: 20ft for speeds in mph without a
            stated height, else 10m.
        start_ffmc: Fine fuel moisture code an hour before the first row, for a file without FFMC.
        bui: Buildup index of every row, for a file without BUI, DMC and DC; None leaves it unknown.
        units: Unit by quantity or column, where the file states none; of ``datetime`` the order of its dates.
        asked: ``wind_gust``, ``cloud``: read too, where the file has them.

    Raises:
        ValueError: In one line, with the file, the column and the row (the first under the header is 1): if the file
            cannot be read, the wind or a unit is missing, a quantity is doubled, a cell is no number or out of range.
    """
    path = _EXAMPLES / f"{path}.csv" if str(path) in ("august",) else Path(path)
    if wind_height not in (None, "10m", "20ft"):
        raise ValueError(f"wind_height must be 10m or 20ft or null, got {wind_height!r}")
    for name, value, high in (("start_ffmc", start_ffmc, 101), ("bui", bui, 2000)):
        if value is not None and not 0 <= value <= high:
            raise ValueError(f"{name} must be in [0, {high}], got {value}")
    sheet = read_sheet(path)
    try:
        sheet, clock = _in_time(sheet, units or {})
        columns, source = find_columns(sheet.headers, sheet.rows, sheet.below, units, asked)
        known, read = _known(columns, sheet)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    height = wind_height or _height(columns, sheet, source)
    _tell(path, {name: columns[name] for name in read}, clock, sheet, source, height)
    hours = torch.tensor(clock.hours, dtype=torch.float32)
    tensors = {name: torch.tensor(values, dtype=torch.float32) for name, values in known.items()}
    made = _complete(tensors, hours, height, start_ffmc, bui)
    return WeatherTable(hours=hours, wind_height=height, began=_began(clock), zone=_zone(clock, sheet, source), **made)


def minutes_until(
    moment: str,
    path: str | Path,
    units: Mapping[str, str] | None = None,
    name: str = "start",
    zone: float | None = None,
) -> float:
    """Return the minutes from the first row of a file to a date and time.

    Args:
        moment: A date and time in the order of the rows' dates, or with the year first; with an offset such as -07:00
            where the rows have offsets, or a zone that the file states.
        path: The file.
        units: See ``read_weather``.
        name: What the moment is, for messages.
        zone: Hours that the rows are ahead of UTC, where neither they nor the file say it.

    Raises:
        ValueError: In one line: if the file cannot be read, has no times, or they are written otherwise.
    """
    path = _EXAMPLES / f"{path}.csv" if str(path) in ("august",) else Path(path)
    sheet = read_sheet(path)
    try:
        sheet, clock = _in_time(sheet, units or {})
        _, source = find_columns(sheet.headers, sheet.rows, sheet.below, units)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    stated = _stated_zone(clock, sheet, source)
    return 60.0 * hours_until(moment, clock, zone if stated is None else stated, name)


def _stated_zone(clock: Clock, sheet: Sheet, source: Source | None) -> float | None:
    """Return the hours that rows without offsets are ahead of UTC, where names or documents say it."""
    stated = (*(zone_of(column) for column in clock.columns), sheet.zone, source.zone if source else None)
    return next((zone for zone in stated if zone is not None), None)


def _zone(clock: Clock, sheet: Sheet, source: Source | None) -> float | None:
    """Return the hours that the clock of ``began`` is ahead of UTC: rows with offsets are converted to UTC."""
    return _stated_zone(clock, sheet, source) if None in clock.offsets else 0.0


def _began(clock: Clock) -> float | None:
    """Return the hours from 1970 to the first row; None without a date, or where it can be read in two ways."""
    first = {moments[0] for moments in clock.moments.values()}
    return first.pop() if len(first) == 1 else None


def _in_time(sheet: Sheet, units: Mapping[str, str]) -> tuple[Sheet, Clock]:
    """Return the table and its times with the first row first; stations often write the newest row on top."""
    clock = read_clock(sheet, next((str(unit) for key, unit in units.items() if plain_name(key) == "datetime"), None))
    if clock.hours[-1] >= 0.0:
        return sheet, clock
    return replace(sheet, rows=sheet.rows[::-1]), clock.reversed()


def _known(columns: Mapping[str, Column], sheet: Sheet) -> tuple[dict[str, list[float]], list[str]]:
    """Return the values of each quantity, and the quantities whose columns were read."""
    values = {name: column_values(name, column, sheet) for name, column in columns.items() if name != "wind_bearing"}
    known = {name: each for name, each in values.items() if each is not None}
    if "wind_bearing" in columns:
        known["wind_bearing"] = bearings(columns["wind_bearing"], sheet, known["wind_speed"])
    read = [name for name in columns if name in known]
    if "wind_u" in known:
        known |= wind_of(known.pop("wind_u"), known.pop("wind_v"))
    if (dew := known.pop("dew_point", None)) and "temperature" in known:
        known["humidity"] = humidity_of(known["temperature"], dew)
    return known, read


def _height(columns: Mapping[str, Column], sheet: Sheet, source: Source | None) -> WindHeight:
    """Return the height of the wind: stated by the column's name, the kind of file or its source, or the usual one."""
    name = "wind_speed" if "wind_speed" in columns else "wind_u"
    column = columns[name]
    is_theirs = source is not None and source.units.get(name, column.unit) == column.unit
    stated = stated_height(column) or sheet.height or (source.height if source and is_theirs else None)
    return cast(WindHeight, stated or ("20ft" if column.unit == "mph" else "10m"))


def _tell(
    path: Path, columns: Mapping[str, Column], clock: Clock, sheet: Sheet, source: Source | None, height: WindHeight
) -> None:
    """Report the columns that were read and ignored, and log warnings about times."""
    for warning in clock.warnings:
        _log.warning("weather: %s", warning)
    read = dict.fromkeys(clock.columns, "time")
    read |= {each.header: f"{name}, {each.unit}" if each.unit else name for name, each in columns.items()}
    notes = [f"wind is that at {height}"]
    if source:
        notes.append(f"its columns have the names of {source.title}, whose units are taken where the file states none")
    report_file(
        Provenance(
            key="weather",
            file=str(path),
            read=read,
            left=(*(header for header in sheet.headers if header and header not in read), *sheet.left),
            notes=(*notes, *clock.warnings),
        )
    )


def _complete(
    known: dict[str, Tensor], hours: Tensor, height: WindHeight, start_ffmc: float, bui: float | None
) -> dict[str, Tensor]:
    """Return the values with computed ones: FFMC, BUI and the moisture of dead fuel."""
    if "ffmc" not in known and {"temperature", "humidity", "rain"} <= known.keys():
        known["ffmc"] = _ffmc_by_row(known, hours, height, start_ffmc)
    if "bui" not in known and {"dmc", "dc"} <= known.keys():
        known["bui"] = buildup_index(known["dmc"], known["dc"])
    elif "bui" not in known and bui is not None:
        known["bui"] = torch.full_like(hours, bui)
    if {"temperature", "humidity"} <= known.keys():
        dead = dead_moisture(known["temperature"], known["humidity"], known.get("rain"))
        known = dict(zip(("dead_1h", "dead_10h", "dead_100h"), dead, strict=True)) | known
    return known


def _ffmc_by_row(known: dict[str, Tensor], hours: Tensor, height: WindHeight, start: float) -> Tensor:
    """Return the fine fuel moisture code at each row [T]; a row's weather is that of the time up to it."""
    wind = known["wind_speed"] * (OPEN_10M_OVER_20FT if height == "20ft" else 1.0)
    lasted = torch.diff(hours, prepend=hours[:1] - 1)
    code, codes = torch.tensor(start, dtype=torch.float32), []
    for air in zip(known["temperature"], known["humidity"], wind, known["rain"], lasted, strict=True):
        code = hourly_ffmc(code, *air)
        codes.append(code)
    return torch.stack(codes)
