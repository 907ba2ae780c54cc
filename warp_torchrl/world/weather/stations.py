"""Files of fire weather stations other than CSV: FARSITE's streams (.wxs, .wnd), and WIMS's fixed columns (FW13, FW9).

Sources: FlamMap's help, "Weather Stream File" and "Wind File"; "Weather Observation Data Transfer Format, 2013" (W13)
and "1998" (W98) of wildfire.gov. English files have miles an hour at 20 ft, Fahrenheit and inches; metric ones have
kilometres an hour at 10 m, Celsius and millimetres.
"""

import re
from typing import Any

from warp_torchrl.system.delimited import to_number

_STREAM = ("Year", "Mth", "Day", "Time", "Temp", "RH", "HrlyPcp", "WindSpd", "WindDir", "CloudCov")
_WIND = ("Mth", "Day", "Time", "WindSpd", "WindDir", "CloudCov")
_UNITS = {"english": ("f", "in", "mph"), "metric": ("c", "mm", "km/h")}
_HEIGHTS = {"english": "20ft", "metric": "10m"}
_HUMIDITY = {"1": None, "2": "RH (%)", "3": "DewPoint"}  # code of moisture: wet bulb, humidity, dew point


def read_station(text: str) -> dict[str, Any] | None:
    """Return the fields of a ``Sheet`` of such a file, None for other texts.

    Raises:
        ValueError: If it is one and cannot be read.
    """
    lines = [line.strip("\r\n") for line in text.splitlines() if line.strip()]
    if lines and re.match(r"W(13|98)\d{6}\d{8}\d{4}", lines[0]):
        return _read_wims(lines)
    if any(re.match(r"\s*RAWS(_UNITS|_ELEVATION)?\s*:", line, re.IGNORECASE) for line in lines[:10]):
        return _read_stream(lines)
    if lines and lines[0].strip().lower() in _UNITS:
        return _read_wind(lines)
    return None


def _read_stream(lines: list[str]) -> dict[str, Any]:
    """Return a weather stream (.wxs); its row of names may be missing."""
    heads = [line for line in lines if re.match(r"\s*RAWS\w*\s*:", line, re.IGNORECASE)]
    told = {key.strip().upper(): value.strip() for key, _, value in (line.partition(":") for line in heads)}
    system = told.get("RAWS_UNITS", "").lower()
    if system not in _UNITS:
        raise ValueError(f"RAWS_UNITS must be English or Metric, got {told.get('RAWS_UNITS') or 'none'}")
    rows = [line.split() for line in lines if line not in heads and not line.lstrip().startswith("#")]
    names = list(_STREAM)
    if rows and to_number(rows[0][0]) is None:
        names, *rows = rows
    _check_cells(rows, len(names))
    count = to_number(told.get("RAWS", "")) or 0.0
    if count > len(rows):
        raise ValueError(f"RAWS must count the rows, it says {count:g} and there are {len(rows)}")
    left = tuple(line.strip() for line in heads if not line.upper().lstrip().startswith("RAWS_UNITS"))
    return _sheet(names, rows, system, left)


def _read_wind(lines: list[str]) -> dict[str, Any]:
    """Return winds (.wnd), whose rows have no year: it is taken to be 2000, a leap year."""
    system = lines[0].strip().lower()
    rows = [line.split() for line in lines[1:]]
    if any(len(row) > 9 for row in rows):
        raise ValueError("weather must have wind: a file of daily weather (.wtr) has none, its wind file (.wnd) has")
    rows = [row + ["0"] * (len(_WIND) - len(row)) if len(row) == 5 else row for row in rows]
    _check_cells(rows, len(_WIND))
    year, months = 2000, [to_number(row[0]) or 0.0 for row in rows]
    dated = []
    for row, month, before in zip(rows, months, [*months[:1], *months], strict=False):
        year += month < before
        dated.append([str(year), *row])
    return _sheet(["Year", *_WIND], dated, system, ())


def _sheet(names: list[str], rows: list[list[str]], system: str, left: tuple[str, ...]) -> dict[str, Any]:
    """Return a stream or wind with the units of its system; English rain is in inches where it has fractions."""
    temperature, rain, speed = _UNITS[system]
    lower = [name.lower() for name in names]
    hour = lower.index("time") if "time" in lower else None
    rows = [[cell.zfill(4) if k == hour else cell for k, cell in enumerate(row)] for row in rows]
    wet = [row[lower.index("hrlypcp")] for row in rows] if "hrlypcp" in lower else []
    is_vague = system == "english" and any(to_number(cell) for cell in wet) and not any("." in cell for cell in wet)
    units = {"temp": temperature, "hrlypcp": "in or in/100" if is_vague else rain, "windspd": speed, "cloudcov": "%"}
    below = [units.get(name, "") for name in lower]
    return {"headers": names, "rows": rows, "below": below, "separator": " ", "left": left, "height": _HEIGHTS[system]}


def _check_cells(rows: list[list[str]], count: int) -> None:
    for number, row in enumerate(rows, 1):
        if len(row) != count:
            raise ValueError(f"rows must have {count} cells as the header, got {len(row)} in row {number}")
    if not rows:
        raise ValueError("weather must have a header and a row, got no row")


def _read_wims(lines: list[str]) -> dict[str, Any]:
    """Return observations (types O and R) of fixed columns; of two in one hour the published one (O)."""
    kept: dict[str, str] = {}
    kinds = {line[61:63] for line in lines}
    if len(kinds) > 1 or len({line[3:9] for line in lines}) > 1:
        raise ValueError("weather must be of one station and in one system of units, got several")
    for number, line in enumerate(lines, 1):
        if not re.match(r"W(13|98)\d{18}", line) or len(line) < 63:
            raise ValueError(f"rows must be W13 or W98 of 63 columns at least, got {line[:24]!r} in row {number}")
        if line[21] in "OR" and (line[9:21] not in kept or line[21] == "O"):
            kept[line[9:21]] = line
    codes = kinds.pop()
    moisture, measure = codes[:1], codes[1:]
    if measure not in ("1", "2") or moisture not in _HUMIDITY or not kept:
        raise ValueError(f"codes of moisture and of units must be 1..3 and 1 or 2, got {moisture!r} and {measure!r}")
    system = "english" if measure == "1" else "metric"
    temperature, _, speed = _UNITS[system]
    headers = ["datetime", "Temp", _HUMIDITY[moisture] or "WetBulb", "WindDir", "WindSpd"]
    cuts = ((9, 21), (23, 26), (26, 29), (29, 32), (32, 35))
    rows = [[line[start:end].strip() for start, end in cuts] for line in kept.values()]
    others = len(lines) - len(rows)
    left = ("rain, which is that of 24 hours", *([f"{others} rows of other types or of one hour"] if others else []))
    below = ["", temperature, temperature if moisture == "3" else "", "", speed]
    return {"headers": headers, "rows": rows, "below": below, "left": left, "height": "20ft", "calm_at_zero": True}
