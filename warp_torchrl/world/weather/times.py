"""Times of the rows of a weather table: hours since the first.

Read by name: `hours` (numbers); a date and time in one column (`datetime`, `time`, `valid_time`, and others); a date
(`date`, `hourly`, or year, month and day, or year and day of the year) with an hour (`hour`, `time`, and others) as 13,
1300, 13:00 or 1:00 PM. Hour 24 is hour 0 of the next day. Offsets such as Z, +02:00 or PDT are converted to one clock.
Seconds and milliseconds since 1970 are read too. Rows in falling order are reversed.

The order of day and month is found from all rows together: the order in which times grow, over the shortest span. If
another order gives a span less than ten times as long, the table is refused, and the user sets `units.datetime=d/m/y`.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median_low

from warp_torchrl.system.delimited import to_number, to_points
from warp_torchrl.world.weather.clock import APART, Clock, dated_clock, since_first
from warp_torchrl.world.weather.columns import plain_name
from warp_torchrl.world.weather.dates import epoch_hours, read_stamp
from warp_torchrl.world.weather.layout import Sheet

_MOMENTS = (
    "datetime datetimelst datetimelocal datetimeutc validtime valid timestamp timestamputc dtiso localdatetimefull "
    "dateutc obstime observationtime fechayhoraoficial fechahora fechayhora datahora datahorautc fint aaaammjjhh "
    "messdatum aifstimeutc localtime utctime timeutc time date fecha data datum hourly dt"
).split()
_CLOCKS = "hour hr time hora horautc timelst timelocal timeutc hh hh24 heure hod uhrzeit".split()
_MINUTES = ("minute", "minutes", "min", "miformatinlocaltime")
_YEARS = "yr year yyyy ano anio annee jahr yearmonthdayhourminutesinyyyy".split()
_MONTHS = "mon month mth mo mm mes mois monat".split()
_DAYS = "day dy dd dia jour tag".split()
_DAYS_OF_YEAR = "doy jday julianday dayofyear yday juliandate".split()
_MONTH = 31 * 24.0
"""A step [hours] that is named as a gap whatever the others are."""
_ORDERS = {"y/m/d": "ymd", "d/m/y": "dmy", "m/d/y": "mdy"}


def read_clock(sheet: Sheet, order: str | None = None) -> Clock:
    """Return the times of the rows of a table.

    Args:
        sheet: The table.
        order: ``y/m/d``, ``d/m/y`` or ``m/d/y``: what the user says of its dates.

    Raises:
        ValueError: If a time cannot be read, does not grow with the row, or can be read in two ways.
    """
    if order is not None and order not in _ORDERS:
        raise ValueError(f"units.datetime must be {', '.join(_ORDERS)}, got {order}")
    names = [plain_name(header.split("(")[0].split("[")[0].split(",")[0]) for header in sheet.headers]
    if "hours" in names:
        clock: Clock | None = _elapsed(sheet, names.index("hours"))
    else:
        columns, texts = _texts(sheet, names)
        clock = dated_clock(texts, columns, _ORDERS[order] if order else None) if any(texts) else None
    if clock is None or (len(sheet.rows) > 1 and len(set(clock.hours)) <= 1):
        return _hourly(sheet, clock)
    _check_growth(clock)
    return _with_gaps(clock)


def _elapsed(sheet: Sheet, place: int) -> Clock:
    header, cells = sheet.headers[place], [row[place].strip() for row in sheet.rows]
    hours = []
    for row, cell in enumerate(to_points(header, cells, sheet.separator), 1):
        value = to_number(cell)
        if value is None:
            raise ValueError(f"hours must be a number, got {cell!r} in row {row}")
        hours.append(value)
    return Clock(hours=since_first(hours), columns=(header,), moments={}, texts=cells, offsets={None})


def _hourly(sheet: Sheet, clock: Clock | None) -> Clock:
    """Return rows an hour apart, for a table without times or with one time in all rows."""
    what = "every row has the same time" if clock else "no column tells the time"
    told = f"{what}; its rows are taken to be an hour apart"
    hours = [float(row) for row in range(len(sheet.rows))]
    columns = clock.columns if clock else ()
    return Clock(
        hours=hours,
        columns=columns,
        warnings=(told,) if len(hours) > 1 else (),
        moments=clock.moments if clock and len(hours) == 1 else {},
        texts=clock.texts if clock else [""] * len(hours),
        offsets=clock.offsets if clock else {None},
    )


def _texts(sheet: Sheet, names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return the columns of dates and times, and one text of them for each row; empty without any."""
    rows = sheet.rows
    place = next((names.index(name) for name in _MOMENTS if name in names and _is_dated(rows, names.index(name))), None)
    if place is None:
        place = next((k for k, name in enumerate(names) if not name and _is_dated(rows, k)), None)  # pandas' index
    clock = _first(names, [name for name in _CLOCKS if place is None or name != names[place]])
    if place is not None:
        if clock is None or not _is_midnight(rows, place):
            return (sheet.headers[place],), [row[place].strip() for row in rows]
        dates = [re.split(r"[ tT]", row[place].strip())[0] for row in rows]
        return (sheet.headers[place], sheet.headers[clock]), _joined(dates, rows, [clock], names)
    year, month, day = (_first(names, words) for words in (_YEARS, _MONTHS, _DAYS))
    of_year = _first(names, _DAYS_OF_YEAR)
    if year is not None and month is not None and day is not None:
        dates = ["-".join((_year(row[year]), row[month].strip(), row[day].strip())) for row in rows]
        used = [year, month, day]
    elif year is not None and of_year is not None:
        dates = [f"{_year(row[year])}-{row[of_year].strip().zfill(3)}" for row in rows]
        used = [year, of_year]
    elif clock is not None:
        dates, used = [""] * len(rows), []
    else:
        return _refusable(sheet, names)
    columns = [*used, *([clock] if clock is not None else [])]
    return tuple(sheet.headers[k] for k in columns), _joined(dates, rows, columns[len(used) :], names)


def _refusable(sheet: Sheet, names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return a column with a name of times, though its first cell is no time; a message shows it."""
    place = _first(names, _MOMENTS)
    if place is None:
        return (), [""] * len(sheet.rows)
    return (sheet.headers[place],), [row[place].strip() for row in sheet.rows]


def _first(names: Sequence[str], words: Sequence[str]) -> int | None:
    return next((names.index(word) for word in words if word in names), None)


def _year(cell: str) -> str:
    cell = cell.strip()
    return cell if len(cell) != 2 else f"{'19' if cell > '68' else '20'}{cell}"


def _joined(dates: list[str], rows: Sequence[Sequence[str]], clock: Sequence[int], names: Sequence[str]) -> list[str]:
    """Return dates with the cells of an hour, and of minutes in a column of their own."""
    minute = _first(names, _MINUTES) if clock else None
    texts = []
    for date, row in zip(dates, rows, strict=True):
        time = " ".join(row[place].strip() for place in clock)
        if minute is not None and time.isdigit():
            time = f"{time}:{row[minute].strip().zfill(2)}"
        texts.append(f"{date} {time.removesuffix('.0')}".strip())
    return texts


def _is_dated(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Return whether the first cell of a column is a date."""
    text = next((row[place].strip() for row in rows if row[place].strip()), "")
    stamp = read_stamp(text)
    return epoch_hours(text) is not None or (stamp is not None and stamp.numbers is not None)


def _is_midnight(rows: Sequence[Sequence[str]], place: int) -> bool:
    """Return whether a column has dates without times."""
    stamps = [read_stamp(row[place]) for row in rows]
    return all(stamp is not None and not stamp.hour and stamp.digits is None for stamp in stamps)


def _check_growth(clock: Clock) -> None:
    falls = len(clock.hours) > 2 and clock.hours[-1] < 0.0
    hours = [-hour for hour in clock.hours] if falls else clock.hours
    for row, (before, after) in enumerate(pairwise(hours), 2):
        if not after > before:
            raise ValueError(
                f"times of weather must grow, got {clock.texts[row - 1]!r} after {clock.texts[row - 2]!r} in row {row}"
            )


def _with_gaps(clock: Clock) -> Clock:
    """Return a clock that warns of steps far longer than the others."""
    steps = [abs(after - before) for before, after in pairwise(clock.hours)]
    usual = median_low(steps) if steps else 0.0
    gaps = [row for row, step in enumerate(steps, 1) if step > min(APART * usual, _MONTH)]
    told = tuple(
        f"{steps[row - 1]:g} hours without weather after {clock.texts[row - 1] or row!r} (row {row}), where rows are "
        f"{usual:g} hours apart; that row holds on"
        for row in gaps[:3]
    )
    more = (f"and {len(gaps) - 3} gaps more",) if len(gaps) > 3 else ()
    return replace(clock, warnings=(*clock.warnings, *told, *more))
