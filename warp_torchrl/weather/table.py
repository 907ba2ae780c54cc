"""Weather by the hour: a table read from a CSV file, with the moistures that follow from it."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.weather.columns import QUANTITIES, Column, find_columns
from warp_torchrl.weather.dead_moisture import dead_moisture
from warp_torchrl.weather.fwi import buildup_index, hourly_ffmc
from warp_torchrl.weather.times import hours_until, row_hours

WindHeight = Literal["10m", "20ft"]
"""At what height over open ground wind was measured: by the Canadian and international custom, or the American."""
_EXAMPLES = Path(__file__).parent / "examples"
OPEN_10M_OVER_20FT = 1.15
"""Wind at 10 m over that at 20 ft in the open (Turner and Lawson 1978, BC-X-177)."""


@dataclass(frozen=True, kw_only=True)
class Weather:
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
    wind_height: WindHeight = "10m"


@dataclass(frozen=True, kw_only=True)
class WeatherTable(Weather):
    """Weather row by row; every tensor float32 [T]. A row holds until the next begins, the last one from then on."""

    hours: Tensor  # since the first row began, growing

    def at(self, minutes: Tensor | float) -> Weather:
        """Return the weather at some minutes since the first row began, in their shape; before, the first row holds."""
        moments = torch.as_tensor(minutes, dtype=torch.float32, device=self.hours.device) / 60
        row = (torch.searchsorted(self.hours, moments.contiguous(), right=True) - 1).clamp(min=0)
        known = {each.name: getattr(self, each.name) for each in fields(Weather)}
        values = {name: value[row] for name, value in known.items() if isinstance(value, Tensor)}
        return Weather(wind_height=self.wind_height, **values)


def read_weather(
    path: str | Path,
    *,
    wind_height: WindHeight | None = None,
    start_ffmc: float = 85.0,
    bui: float | None = None,
) -> WeatherTable:
    """Return the weather of a CSV file, a row an hour or as its times say.

    What is read, by what names and in what units, `warp_torchrl.weather.columns` says; how times are read,
    `warp_torchrl.weather.times`. Fields are separated by commas, semicolons or tabs. What is not in the file is
    computed where it can be: FFMC by the hour from temperature, humidity, wind and rain; BUI from DMC and DC; dead
    moistures from temperature and humidity.

    Args:
        path: The file; or the name of one that comes with the package: ``august``, three hot dry days, made up.
        wind_height: At what height the wind was measured; None is 20ft for speeds in mph, else 10m.
        start_ffmc: Fine fuel moisture code an hour before the first row, where it is to be computed.
        bui: Buildup index of every row, where the file has none and neither DMC nor DC; None leaves it unknown.

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
    headers, rows = _read_rows(path)
    try:
        columns = find_columns(headers)
        hours = torch.tensor(row_hours(headers, rows), dtype=torch.float32)
        values = {name: _values(name, column, rows) for name, column in columns.items()}
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    height: WindHeight = wind_height or ("20ft" if columns["wind_speed"].unit == "mph" else "10m")
    known = {name: value for name, value in values.items() if value is not None}
    return WeatherTable(hours=hours, wind_height=height, **_complete(known, hours, height, start_ffmc, bui))


def minutes_until(moment: str, path: str | Path) -> float:
    """Return the minutes from the first row of a CSV file to a date and time, written as its rows have them.

    Raises:
        ValueError: In one line: if the file cannot be read, has no times, or they are written otherwise.
    """
    headers, rows = _read_rows(Path(path))
    return 60.0 * hours_until(moment, headers, rows)


def _read_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text in UTF-8"
        raise ValueError(f"weather must be a CSV file that can be read, got {path}: {why}") from None
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    table = [row for row in csv.reader(text.splitlines(), delimiter=separator) if any(cell.strip() for cell in row)]
    if len(table) < 2:
        raise ValueError(f"{path}: weather must have a header and a row, got {len(table)} lines")
    headers, *rows = table
    for number, row in enumerate(rows, 1):
        if len(row) != len(headers):
            raise ValueError(
                f"{path}: rows must have {len(headers)} cells as the header, got {len(row)} in row {number}"
            )
    return [header.strip() for header in headers], rows


def _values(name: str, column: Column, rows: Sequence[Sequence[str]]) -> Tensor | None:
    """Return a column's values in our unit [T]; None where all its cells are empty."""
    cells = [row[column.place].strip() for row in rows]
    if not any(cells) and name not in ("wind_speed", "wind_bearing"):
        return None
    values = []
    for number, cell in enumerate(cells, 1):
        values.append(column.factor * _number(column.header, cell, number) + column.offset)
        quantity = QUANTITIES[name]
        if not quantity.lowest - 1e-6 <= values[-1] <= quantity.highest + 1e-6:
            limits = f"[{quantity.lowest:g}, {quantity.highest:g}] {quantity.unit}".strip()
            raise ValueError(f"{column.header} must be in {limits}, got {values[-1]:g} in row {number}")
    return torch.tensor(values, dtype=torch.float32)


def _number(header: str, cell: str, row: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{header} must be a number, got {cell!r} in row {row}")
    return value


def _complete(
    known: dict[str, Tensor], hours: Tensor, height: WindHeight, start_ffmc: float, bui: float | None
) -> dict[str, Tensor]:
    """Return the values with what follows from them: FFMC, BUI and the moisture of dead fuel."""
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
