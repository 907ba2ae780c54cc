"""When each row of a table of weather holds: hours since the first."""

import logging
import re
from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise

_log = logging.getLogger("warp_torchrl")
_MOMENTS = ("datetime", "date_time", "timestamp")
_CLOCKS = ("hour", "hr", "time")
_PARTS = (("yr", "year"), ("mon", "month", "mth"), ("day",))
_DATES = ("%Y-%m-%d", "%d-%m-%Y", "%m-%d-%Y", "%d-%m-%y", "%m-%d-%y", "%Y-%d-%m", "%Y%m%d")
_TIMES = ("", " %H:%M", " %H:%M:%S", " %H", " %H%M")


def row_hours(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[float]:
    """Return the hours from the first row to each.

    Read are, by name in any case: `hours` (numbers); `datetime`, `date_time` or `timestamp`; or `date`, or `year`
    (`yr`), `month` (`mon`, `mth`) and `day`, with `hour` (`hr`, `time`) as 13, 1300 or 13:00. Dates are numbers with
    hyphens, slashes, dots or nothing between. Of the ways to read them all (day first, month first, year first) that
    do not go back in time, the one with the shortest time between the first row and the last is taken. Without such
    columns, and where every row has the same time, rows are an hour apart, and a line of the log says so.

    Raises:
        ValueError: If a time cannot be read, or does not grow, with the row.
    """
    names = [re.sub(r"[\s-]", "", header.lower()) for header in headers]
    if "hours" in names:
        texts = [row[names.index("hours")].strip() for row in rows]
        hours = _numbers(texts)
    else:
        texts = _texts(names, rows)
        hours = _read(texts)
    if len(rows) > 1 and len(set(hours)) <= 1:
        what = "every row has the same time" if any(texts) else "no column tells the time"
        _log.warning("weather: %s; its rows are taken to be an hour apart", what)
        return [float(row) for row in range(len(rows))]
    for row, (before, after) in enumerate(pairwise(hours), 2):
        if not after > before:
            raise ValueError(
                f"times of weather must grow, got {texts[row - 1]!r} after {texts[row - 2]!r} in row {row}"
            )
    return [hour - hours[0] for hour in hours]


def hours_until(moment: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> float:
    """Return the hours from the first row to a moment that is written as the rows' times are.

    Raises:
        ValueError: If the rows tell no times, or the moment is not written as they are.
    """
    texts = _texts([re.sub(r"[\s-]", "", header.lower()) for header in headers], rows)
    if len({*texts}) < min(2, len(texts)) or not any(texts):
        raise ValueError(f"start must be in minutes where rows tell no dates and times of their own, got {moment!r}")
    together = [*_plain(texts), *_plain([moment])]
    fitting = [each for each in _readings(together) if each[:-1] == sorted(each[:-1])]
    if not fitting:
        raise ValueError(f"start must be a date and time as the first row has it, {texts[0]!r}, got {moment!r}")
    best = min(fitting, key=lambda reading: reading[-2] - reading[0])
    return best[-1] - best[0]


def _numbers(texts: Sequence[str]) -> list[float]:
    for row, text in enumerate(texts, 1):
        if not re.fullmatch(r"[-+]?\d+\.?\d*|[-+]?\.\d+", text):
            raise ValueError(f"hours must be a number, got {text!r} in row {row}")
    return [float(text) for text in texts]


def _texts(names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return one text of the date and the time of each row; empty where the table has neither."""
    clock = [names.index(name) for name in _CLOCKS if name in names][:1]
    for name in (*_MOMENTS, "date"):
        if name in names:
            places = [names.index(name), *(clock if name == "date" else [])]
            return [" ".join(row[place].strip() for place in places) for row in rows]
    parts = [[names.index(name) for name in words if name in names][:1] for words in _PARTS]
    if not all(parts):
        return [""] * len(rows)
    texts = []
    for row in rows:
        year, month, day = (row[place].strip().zfill(2) for (place,) in parts)
        texts.append(" ".join([f"{year}-{month}-{day}", *(row[place].strip() for place in clock)]))
    return texts


def _read(texts: Sequence[str]) -> list[float]:
    """Return hours since some moment, in the reading of the texts that suits them best."""
    if not any(texts):
        return [0.0] * len(texts)
    plain = _plain(texts)
    readings = _readings(plain)
    if not readings:
        _refuse(texts, plain)
    forward = [each for each in readings if each == sorted(each)] or readings[:1]
    return min(forward, key=lambda reading: reading[-1] - reading[0])


def _plain(texts: Sequence[str]) -> list[str]:
    """Return the texts with hyphens in their dates and four digits where an hour has no colon."""
    plain = [re.sub(r"[./]", "-", re.sub(r"(?<=\d)T", " ", text.upper()).removesuffix("Z")) for text in texts]
    return [re.sub(r" (\d{1,3})$", lambda clock: " " + _clock(clock[1]), text) for text in plain]


def _readings(plain: Sequence[str]) -> list[list[float]]:
    """Return the hours since some moment in each way to read all the texts."""
    return [reading for date in _DATES for time in _TIMES if (reading := _parse(plain, date + time))]


def _clock(digits: str) -> str:
    """Return an hour such as 5, or a time such as 530, in four digits."""
    return f"{digits:0>2}00" if len(digits) < 3 else digits.zfill(4)


def _parse(texts: Sequence[str], form: str) -> list[float] | None:
    try:
        moments = [datetime.strptime(text, form) for text in texts]
    except ValueError:  # this form is not theirs
        return None
    return [(moment - datetime(1970, 1, 1)).total_seconds() / 3600 for moment in moments]


def _refuse(texts: Sequence[str], plain: Sequence[str]) -> None:
    """Say the first row that no form that suits the rows before it can read."""
    forms = [date + time for date in _DATES for time in _TIMES]
    for row, text in enumerate(plain, 1):
        forms = [form for form in forms if _parse([text], form)]
        if not forms:
            raise ValueError(
                f"times of weather must be dates and times of one form, got {texts[row - 1]!r} in row {row}"
            )
