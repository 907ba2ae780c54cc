"""Observations of a file: perimeters with times, or hot spots of satellites."""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import torch

from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.system.delimited import SEPARATORS, named_separator, read_table_text, split_rows
from warp_torchrl.system.provenance import Provenance, report_file
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.vector import SUFFIXES, Shape, in_grid, mark, read_shapes
from warp_torchrl.world.weather.columns import plain_name
from warp_torchrl.world.weather.dates import epoch_hours

_SINCE_START = {"minutes": 1.0, "hours": 60.0}
_MOMENTS = (
    "datetime time timestamp date perimeterdatetime polygondatetime polypolygondatetime polydatecurrent datecurrent "
    "datetimelocal datetimeutc validtime observed observationtime acqdatetime"
).split()
_LATITUDE, _LONGITUDE = ("latitude", "lat"), ("longitude", "lon", "lng", "long")
_PASS = 10.0  # minutes: hot spots that are no farther apart are of one pass
Moment = Callable[[str], float]
"""Returns the minutes from the fires' start to a date and time."""


def read_observations(
    path: str | Path, grid: Grid, corner: tuple[int, int], size: tuple[int, int], moment: Moment, end: float
) -> list[Observation]:
    """Return the observations of a file in the order of time.

    Perimeters are polygons of GeoJSON or a shapefile, each with ``minutes`` or ``hours`` since the start or a date and
    time among its properties; polygons of one time are one. Hot spots are a CSV of ``latitude`` and ``longitude`` with
    ``acq_date`` and ``acq_time`` (UTC), or ``minutes`` or ``hours`` since the start; those of ten minutes are one pass.

    Args:
        path: The file.
        grid: Of the landscape.
        corner: (row, column) of the map's first cell in the grid.
        size: (H, W) of the map.
        moment: For dates and times.
        end: The last minute that can be forecast; what is not after the start, or is later, is left out and named.

    Raises:
        ValueError: In one line, if the file cannot be read or placed, has no times, or holds nothing in that time.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in (".csv", *SUFFIXES) or not file.is_file():
        kinds = ", ".join((".csv", *SUFFIXES))
        raise ValueError(f"observed must name a file that exists, one of {kinds}, got {path}")
    place = slice(corner[0], corner[0] + size[0]), slice(corner[1], corner[1] + size[1])
    found = _hot_spots(file, grid, place, moment) if suffix == ".csv" else _perimeters(file, grid, place, moment)
    kept = [each for each in found if 0.0 < each.minutes < end]
    left = len(found) - len(kept)
    if not kept:
        times = f"{found[0].minutes:g} to {found[-1].minutes:g} minutes" if found else "none"
        raise ValueError(f"observed must be seen after the start, within {end:g} minutes, {path} has {times}")
    notes = [f"{len(kept)} observations, {kept[0].minutes / 60.0:.2f} to {kept[-1].minutes / 60.0:.2f} hours"]
    notes += [f"{left} before the start or after the end are left out"] if left else []
    report_file(Provenance(key="observed", file=str(path), notes=tuple(notes)))
    return kept


def _perimeters(file: Path, grid: Grid, place: tuple[slice, slice], moment: Moment) -> list[Observation]:
    shapes = read_shapes("observed", file, grid)
    kinds = sorted({shape.part.kind for shape in shapes} - {"Polygon"})
    if kinds:
        raise ValueError(f"observed must hold polygons, {file} has {', '.join(kinds)}")
    by_time: dict[float, list[Shape]] = {}
    for shape in shapes:
        by_time.setdefault(_time_of(shape.properties, file, moment), []).append(shape)
    found = []
    for minutes in sorted(by_time):
        cells = torch.from_numpy(mark(by_time[minutes], grid)[place])
        if bool(cells.any()):
            found.append(Observation(minutes=minutes, kind="perimeter", cells=cells))
    return found


def _time_of(properties: Mapping[str, Any], file: Path, moment: Moment) -> float:
    """Return the minutes since the start of a feature's properties."""
    named = {plain_name(str(name)): (str(name), value) for name, value in properties.items() if value is not None}
    for name, factor in _SINCE_START.items():
        if name in named:
            return _number(named[name][1], named[name][0], file) * factor
    there = [name for name in _MOMENTS if name in named]
    if not there:
        wanted = "minutes or hours since the start, or datetime"
        raise ValueError(f"observed must have {wanted} among the properties of each polygon, {file} has {_told(named)}")
    if len({str(named[name][1]) for name in there}) > 1:
        each = " and ".join(f"{named[name][0]} {named[name][1]}" for name in there[:2])
        raise ValueError(f"observed must have one time for each polygon, {file} has {each}")
    return _at(str(named[there[0]][1]), moment, file)


def _told(named: Mapping[str, tuple[str, Any]]) -> str:
    return ", ".join(name for name, _ in list(named.values())[:6]) or "none"


def _at(text: str, moment: Moment, file: Path) -> float:
    """Return the minutes of a date and time, or of seconds or milliseconds since 1970."""
    hours = epoch_hours(text)
    if hours is not None:
        text = (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(hours=hours)).strftime("%Y-%m-%dT%H:%M:%SZ")
    try:
        return moment(text)
    except ValueError as error:
        raise ValueError(f"observed: {file}: {error}") from None


def _number(value: object, name: str, file: Path) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(str(value))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"observed must have a number for {name}, {file} has {value!r}")
    return number


def _hot_spots(file: Path, grid: Grid, place: tuple[slice, slice], moment: Moment) -> list[Observation]:
    rows = _rows(file)
    names = {plain_name(name): name for name in rows[0]}
    at = [next((names[name] for name in pair if name in names), None) for pair in (_LONGITUDE, _LATITUDE)]
    if None in at:
        raise ValueError(f"observed must have the columns latitude and longitude, {file} has {', '.join(rows[0])}")
    x, y = (np.array([_number(row[str(name)], str(name), file) for row in rows]) for name in at)
    bad = (np.abs(x) > 180.0) | (np.abs(y) > 90.0)
    if bad.any():
        first = int(bad.argmax())
        raise ValueError(
            f"observed must have degrees for places, row {first + 1} of {file} has {y[first]:g}, {x[first]:g}"
        )
    minutes = _minutes_of(rows, names, moment, file)
    east, north = in_grid("observed", x, y, "EPSG:4326", grid)
    inverse = ~grid.transform
    column, row = (np.floor(inverse[k] * east + inverse[k + 1] * north + inverse[k + 2]) for k in (0, 3))
    inside = (row >= place[0].start) & (row < place[0].stop) & (column >= place[1].start) & (column < place[1].stop)
    if not inside.any():
        raise ValueError(f"observed must have hot spots on the map, {file} has {len(rows)}, none of them there")
    found: list[Observation] = []
    size = place[0].stop - place[0].start, place[1].stop - place[1].start
    order = np.flatnonzero(inside)[np.argsort(minutes[inside], kind="stable")]
    begun = -math.inf
    for index in order:
        if minutes[index] - begun > _PASS:
            begun = float(minutes[index])
            found.append(Observation(minutes=begun, kind="hot_spots", cells=torch.zeros(size, dtype=torch.bool)))
        found[-1].cells[int(row[index]) - place[0].start, int(column[index]) - place[1].start] = True
    return found


def _rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV by the names of its columns."""
    named, text = named_separator(read_table_text("observed", file))
    separator = named or max(SEPARATORS[:-1], key=text.partition("\n")[0].count)
    try:
        table = [row for row in split_rows(text, separator) if row and not row[0].startswith("#")]
    except ValueError as error:
        raise ValueError(f"observed: {file}: {error}") from None
    if len(table) < 2:
        raise ValueError(f"observed must have a header and a hot spot at least, {file} has {len(table)} lines")
    short = next((number for number, row in enumerate(table) if len(row) != len(table[0])), None)
    if short is not None:
        got = len(table[short])
        raise ValueError(f"observed must have {len(table[0])} cells in each row, row {short} of {file} has {got}")
    return [dict(zip(table[0], row, strict=True)) for row in table[1:]]


def _minutes_of(rows: Sequence[Mapping[str, str]], names: Mapping[str, str], moment: Moment, file: Path) -> np.ndarray:
    """Return the minutes since the start of each hot spot, float64 [n]."""
    for name, factor in _SINCE_START.items():
        if name in names:
            return np.array([_number(row[names[name]], names[name], file) * factor for row in rows])
    if "acqdate" in names and "acqtime" in names:
        texts = [f"{row[names['acqdate']]}T{_clock(row[names['acqtime']], file)}Z" for row in rows]
    elif there := [names[name] for name in _MOMENTS if name in names]:
        texts = [row[there[0]] for row in rows]
    else:
        wanted = "acq_date and acq_time, or minutes since the start"
        raise ValueError(f"observed must have the columns {wanted}, {file} has {', '.join(rows[0])}")
    known = {text: _at(text, moment, file) for text in set(texts)}
    return np.array([known[text] for text in texts])


def _clock(text: str, file: Path) -> str:
    """Return hours and minutes of an ``acq_time``: 412, 0412 or 04:12."""
    digits = text.replace(":", "")[:4].zfill(4)
    if not digits.isdigit() or int(digits[:2]) > 23 or int(digits[2:]) > 59:
        raise ValueError(f"observed must have acq_time in hours and minutes, {file} has {text!r}")
    return f"{digits[:2]}:{digits[2:]}"
