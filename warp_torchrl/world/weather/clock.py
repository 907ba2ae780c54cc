"""Times of a table's rows: one format for all dates and times of the table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from warp_torchrl.world.weather.dates import ORDERS, Stamp, epoch_hours, read_stamp

APART = 10.0
"""How many times as long a reading must be to be out of the question."""


@dataclass(frozen=True, kw_only=True)
class Clock:
    """The times of a table's rows.

    Attributes:
        hours: From the first row to each; falling where the last row is the first in time.
        columns: Columns of dates and times.
        warnings: Warnings for the user.
        moments: Hours of each row since 1970 on one clock, in every order of dates that makes these hours.
        texts: Date and time of each row, as messages show them.
        offsets: Hours ahead of UTC that rows state; None for a row without an offset.
    """

    hours: list[float]
    columns: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    moments: dict[str, list[float]]
    texts: list[str]
    offsets: set[float | None]

    def reversed(self) -> "Clock":
        """Return the clock of rows in the order of time, for a table whose last row is the first."""
        moments = {order: hours[::-1] for order, hours in self.moments.items()}
        hours = [hour - self.hours[-1] for hour in self.hours[::-1]]
        told = (*self.warnings, "its last row is the first in time; it is read from there")
        return replace(self, hours=since_first(hours), moments=moments, texts=self.texts[::-1], warnings=told)


def hours_until(moment: str, clock: Clock, zone: float | None, name: str = "start") -> float:
    """Return the hours from the first row to a date and time.

    Args:
        moment: The text. With an offset it is converted to the rows' clock, without one it is on that clock.
        clock: Of the rows.
        zone: Hours that the rows' clock is ahead of UTC, where their offsets do not say it.
        name: What the moment is, for messages.

    Raises:
        ValueError: If the rows have no times, or the moment has another form.
    """
    if not clock.moments:
        raise ValueError(f"{name} must be in minutes where rows tell no dates and times of their own, got {moment!r}")
    stamp = read_stamp(moment)
    if stamp is None or stamp.numbers is None:
        raise ValueError(f"{name} must be a date and time as the first row has it, {clock.texts[0]!r}, got {moment!r}")
    shift = _shift(moment, stamp, clock, zone, name)
    found = set()
    for order, rows in clock.moments.items():
        for own in _own_orders(stamp, order):
            try:
                found.add(round(stamp.hours(own, _is_clock([stamp])) - shift - rows[0], 6))
            except (ValueError, OverflowError):  # no date in this order
                continue
    within = {hours for hours in found if 0.0 <= hours <= clock.hours[-1]} or found
    if len(within) != 1:
        why = "it can be read in two ways: write it as 2024-07-01 12:00" if within else "its numbers are no date"
        raise ValueError(
            f"{name} must be a date and time as the first row has it, {clock.texts[0]!r}, got {moment!r}: {why}"
        )
    return within.pop()


def _own_orders(stamp: Stamp, order: str) -> tuple[str, ...]:
    """Return the orders in which a moment may be written where rows have one order."""
    if stamp.is_long[0]:
        return ("ymd",)
    if order in ("dmy", "mdy") or (order in ORDERS and not stamp.is_long[1]):
        return (order,)
    return ORDERS


def _shift(moment: str, stamp: Stamp, clock: Clock, zone: float | None, name: str) -> float:
    """Return the hours that a moment, with its offset, is ahead of the rows' clock."""
    has_own, rows = stamp.offset is not None, clock.offsets
    if has_own and None in rows:
        if zone is None:
            raise ValueError(f"{name} must have no offset where the rows have none, {clock.texts[0]!r}, got {moment!r}")
        return -zone
    if not has_own and None not in rows:
        if len(rows) > 1:
            raise ValueError(f"{name} must have an offset where rows have several, {clock.texts[0]!r}, got {moment!r}")
        return next(iter(rows)) or 0.0
    return 0.0


def dated_clock(texts: list[str], columns: tuple[str, ...], order: str | None) -> Clock:
    """Return the clock of texts, in the order of dates that fits them.

    Args:
        texts: Dates and times, one text per row.
        columns: Columns of the texts.
        order: Order of day, month and year, given by the user; None finds it from the rows.

    Raises:
        ValueError: If a text cannot be read, or all of them in two ways.
    """
    epochs = [epoch_hours(text) for text in texts]
    stamps = [read_stamp(text) for text in texts]
    if all(epoch is not None for epoch in epochs) and _is_epoch(stamps):
        hours = [epoch or 0.0 for epoch in epochs]
        return Clock(hours=since_first(hours), columns=columns, moments={"epoch": hours}, texts=texts, offsets={0.0})
    for row, (text, stamp) in enumerate(zip(texts, stamps, strict=True), 1):
        if stamp is None or (stamp.numbers is None) != _is_bare(stamps):
            raise ValueError(f"times of weather must be dates and times of one form, got {text!r} in row {row}")
    known = [stamp for stamp in stamps if stamp is not None]
    offsets = {stamp.offset for stamp in known}
    if None in offsets and len(offsets) > 1:
        row = 1 + [stamp.offset is None for stamp in known].index(known[0].offset is not None)
        raise ValueError(f"times of weather must all have an offset or none, got {texts[row - 1]!r} in row {row}")
    if _is_bare(stamps):
        return Clock(
            hours=_rolling(known, texts),
            columns=columns,
            warnings=("no column tells the date; a time before that of the row above is taken to be the next day's",),
            moments={},
            texts=texts,
            offsets={None},
        )
    return _chosen(known, texts, columns, order, offsets)


def _is_bare(stamps: Sequence[Stamp | None]) -> bool:
    """Return whether the first text is a time without a date."""
    return stamps[0] is not None and stamps[0].numbers is None


def _is_epoch(stamps: Sequence[Stamp | None]) -> bool:
    """Return whether numbers are no dates such as 2024070112."""
    if any(stamp is None for stamp in stamps):
        return True
    try:
        for stamp in stamps:
            stamp.hours("ymd") if stamp else None
    except ValueError:
        return True
    return False


def _is_clock(stamps: Sequence[Stamp]) -> bool:
    """Return whether times of few digits are hours and minutes: some have more digits than an hour."""
    return any(len(stamp.digits or "") > 2 for stamp in stamps)


def _rolling(stamps: Sequence[Stamp], texts: Sequence[str]) -> list[float]:
    hours: list[float] = []
    for row, stamp in enumerate(stamps, 1):
        try:
            hour = stamp.clock(_is_clock(stamps))
        except ValueError as error:
            raise ValueError(f"times of weather: {error}, got {texts[row - 1]!r} in row {row}") from None
        days = 0.0 if not hours else 24.0 * (hours[-1] // 24.0)
        hours.append(days + hour + (24.0 if hours and days + hour < hours[-1] else 0.0))
    return since_first(hours)


def _chosen(
    stamps: Sequence[Stamp], texts: list[str], columns: tuple[str, ...], order: str | None, offsets: set[float | None]
) -> Clock:
    """Return the clock in the order of dates that fits all rows.

    Raises:
        ValueError: If no order fits, or two orders fit with different hours.
    """
    readings = _readings(stamps, texts, order)
    forward = {each: hours for each, hours in readings.items() if hours == sorted(hours)}
    forward = forward or {each: hours for each, hours in readings.items() if hours == sorted(hours, reverse=True)}
    readings = forward or dict([*readings.items()][:1])
    spans = {each: abs(hours[-1] - hours[0]) for each, hours in readings.items()}
    best = min(spans, key=lambda each: spans[each])
    hours = since_first(readings[best])
    same = {each: moments for each, moments in readings.items() if since_first(moments) == hours}
    rival = next((each for each in readings if each not in same and spans[each] < APART * spans[best]), None)
    if rival:
        ways = " or ".join("/".join(each) for each in (best, rival))
        raise ValueError(
            f"times of weather can be read as {ways}, got {texts[0]!r} to {texts[-1]!r}: write years first, as in "
            f"2024-07-01, or say units.datetime={'/'.join(best)}"
        )
    return Clock(hours=hours, columns=columns, moments=same, texts=texts, offsets=offsets)


def _readings(stamps: Sequence[Stamp], texts: Sequence[str], order: str | None) -> dict[str, list[float]]:
    """Return the hours since 1970 of each row in each order that fits all of them.

    Raises:
        ValueError: If none does, with the first row that rules out the last.
    """
    is_clock, readings, farthest = _is_clock(stamps), {}, 0
    for each in (order,) if order else ORDERS:
        hours: list[float] = []
        try:
            for stamp in stamps:
                hours.append(stamp.hours(each, is_clock))
        except (ValueError, OverflowError):
            farthest = max(farthest, len(hours))
            continue
        readings[each] = hours
        if each == "ymd" and stamps[0].is_long[0]:  # years first and months next: so it is written everywhere
            break
    if not readings:
        text = texts[farthest]
        raise ValueError(f"times of weather must be dates and times of one form, got {text!r} in row {farthest + 1}")
    return readings


def since_first(hours: list[float]) -> list[float]:
    """Return hours since the first."""
    return [round(hour - hours[0], 9) for hour in hours]
