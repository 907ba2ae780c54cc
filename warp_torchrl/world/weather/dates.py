"""Tokens of one date and time in text, before the order of day and month is known."""

import re
from dataclasses import dataclass
from datetime import datetime, timedelta

ORDERS = ("ymd", "dmy", "mdy", "ydm")
"""Ways to read the three numbers of a date: year, month, day and so on."""
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_OFFSETS = {
    **{"z": 0.0, "utc": 0.0, "gmt": 0.0, "wet": 0.0, "west": 1.0, "bst": 1.0, "cet": 1.0, "cest": 2.0},
    **{"eet": 2.0, "eest": 3.0, "est": -5.0, "edt": -4.0, "cst": -6.0, "cdt": -5.0, "mst": -7.0, "mdt": -6.0},
    **{"pst": -8.0, "pdt": -7.0, "akst": -9.0, "akdt": -8.0, "nst": -3.5, "ndt": -2.5, "ast": -4.0, "adt": -3.0},
    **{"aest": 10.0, "aedt": 11.0, "acst": 9.5, "acdt": 10.5, "awst": 8.0, "brt": -3.0, "clt": -4.0, "clst": -3.0},
}
"""Hours ahead of UTC by the words that weather services write behind a time."""
_DATE = r"(?P<a>\d{1,4})[-/.](?P<b>\d{1,2}|[a-z]{3,9})[-/.,]?(?P<c>\d{1,4})"
_WORDS = r"(?P<a>\d{1,2})?\s*(?P<b>[a-z]{3,9})\.?\s+(?P<d>\d{1,2}(?=,))?,?\s*(?P<c>\d{4})"
_DAY_OF_YEAR = r"(?P<year>\d{4})-(?P<day>\d{3})"
_CLOCK = r"(?P<hour>\d{1,2})(?:[:h](?P<minute>\d\d)(?::(?P<second>\d\d(?:[.,]\d+)?))?)?h?"
_DIGITS = r"(?P<digits>\d{3,4}|\d{6})"
_HALF = r"(?:\s*(?P<half>[ap])\.?\s?m\.?)?"
_ZONE = r"(?:\s*(?P<zone>(?:utc|gmt)?\s?[+-]\d\d?(?::?\d\d)?(?:\s*utc)?|[a-z]{1,5}))?"
_TIME = rf"(?:{_CLOCK}|{_DIGITS}){_HALF}{_ZONE}"
_FORMS = [
    re.compile(form, re.ASCII)
    for form in (
        rf"(?P<compact>\d{{8}})(?:[t ]?{_TIME})?",
        rf"{_DAY_OF_YEAR}(?:[t ]\s*{_TIME})?",
        rf"{_DATE}(?:(?:\s*t\s*|\s+|(?<=\d):){_TIME})?",
        rf"{_WORDS}(?:,?\s+{_TIME})?",
        rf"(?:{_CLOCK}|{_DIGITS}){_HALF}(?:\s*(?P<zone>z|utc|gmt))?",  # 2024-7 is no time with an offset
    )
]
_EPOCH = re.compile(r"-?\d{9,10}(?:\.\d+)?|\d{13}", re.ASCII)


@dataclass(frozen=True)
class Stamp:
    """The parts of one text."""

    numbers: tuple[int, int, int] | None  # of the date, as they are written; of year, 0, day of the year
    is_long: tuple[bool, bool]  # whether the first and the last number have four digits
    month: int | None  # where a word says it
    hour: float | None  # since midnight; None where the text tells no time
    digits: str | None  # of a time without a colon that is not 4 or 6 digits long
    offset: float | None  # hours ahead of UTC

    def hours(self, order: str, is_clock: bool = False) -> float:
        """Return the hours since 1970 on this text's clock, in UTC where it has an offset.

        Args:
            order: One of ``ORDERS``.
            is_clock: Whether times of few digits are hours and minutes (100 is one o'clock), not hours.

        Raises:
            ValueError: If its numbers are no date in this order, or no time.
        """
        return self._days(order) * 24.0 + self.clock(is_clock) - (self.offset or 0.0)

    def clock(self, is_clock: bool = False) -> float:
        """Return the hours since midnight, 0 in a text without a time; 24 is the next day's 0."""
        if self.digits is not None:
            hour, minute = divmod(int(self.digits), 100) if is_clock else (int(self.digits), 0)
            hours = hour + minute / 60.0
            if minute > 59:
                raise ValueError("minutes must be under 60")
        else:
            hours = self.hour or 0.0
        if hours > 24.0:
            raise ValueError("hours must be 24 at most")
        return hours

    def _days(self, order: str) -> int:
        if self.numbers is None:
            return 0
        by_part = dict(zip(order, self.numbers, strict=True))
        long = self.is_long[order.index("y") // 2] if "y" in (order[0], order[2]) else False
        if any(self.is_long) and not long:
            raise ValueError("the year is the number of four digits")
        year, month, day = by_part["y"], by_part["m"], by_part["d"]
        if not long:
            year += 1900 if year > 68 else 2000
        if self.month is not None:
            month = self.month
        elif self.numbers[1] == 0:  # a day of the year
            return (datetime(year, 1, 1) + timedelta(days=self.numbers[2] - 1) - datetime(1970, 1, 1)).days
        return (datetime(year, month, day) - datetime(1970, 1, 1)).days


def epoch_hours(text: str) -> float | None:
    """Return the hours since 1970 of a number of seconds or milliseconds since then; None for another text."""
    if not _EPOCH.fullmatch(text.strip()):
        return None
    return float(text) / (3.6e6 if len(text.strip()) == 13 else 3600.0)


def read_stamp(text: str) -> Stamp | None:
    """Return the parts of a text that is a date, a time or both; None for any other."""
    text = re.sub(r"\[.*\]$", "", text.strip().strip("'\"").lower()).strip()
    text = re.sub(r"^(?:mon|tue|wed|thu|fri|sat|sun)[a-z]*,?\s+", "", text)
    if found := re.fullmatch(r"(\d{8})(\d{2})(?:(\d{2})(\d{2})?)?", text, re.ASCII):  # no separator at all
        text = f"{found[1]}t{found[2]}:{found[3] or '00'}:{found[4] or '00'}"
    for form in _FORMS:
        if found := form.fullmatch(text):
            try:
                return _stamp({"half": None, **found.groupdict()})
            except ValueError:
                continue
    return None


def _stamp(parts: dict[str, str | None]) -> Stamp:
    numbers, is_long, month = _date(parts)
    hour, digits = _hour(parts)
    return Stamp(numbers, is_long, month, hour, digits, _offset(parts.get("zone")))


def _date(parts: dict[str, str | None]) -> tuple[tuple[int, int, int] | None, tuple[bool, bool], int | None]:
    if compact := parts.get("compact"):
        return (int(compact[:4]), int(compact[4:6]), int(compact[6:])), (True, False), None
    if parts.get("year"):
        return (int(parts["year"] or 0), 0, int(parts["day"] or 0)), (True, False), None
    second, last = parts.get("b"), parts.get("c")
    first = parts.get("a") or parts.get("d")
    if second is None or first is None or last is None:
        if second is not None:
            raise ValueError("a date must have three parts")
        return None, (False, False), None
    month = None
    if not second.isdigit():
        if second[:3] not in _MONTHS:
            raise ValueError("a month must have its name")
        month = 1 + _MONTHS.index(second[:3])
    long = (len(first) == 4, len(last) == 4)
    if len(first) == 3 or len(last) == 3 or all(long):
        raise ValueError("a date must have a year of two or four digits")
    return (int(first), month or int(second), int(last)), long, month


def _hour(parts: dict[str, str | None]) -> tuple[float | None, str | None]:
    """Return the hours since midnight, or the digits of a time that may be hours, or hours and minutes."""
    digits = parts.get("digits")
    if digits and len(digits) == 6:
        return int(digits[:2]) + int(digits[2:4]) / 60.0 + int(digits[4:]) / 3600.0, None
    if digits:
        return None, digits
    hour = parts.get("hour")
    if hour is None:
        return None, None
    if parts.get("minute") is None and not parts.get("half"):
        return None, hour
    minute, second = int(parts["minute"] or 0), float((parts["second"] or "0").replace(",", "."))
    if minute > 59 or second >= 60.0:
        raise ValueError("minutes and seconds must be under 60")
    whole = int(hour)
    if parts.get("half"):
        if not 1 <= whole <= 12:
            raise ValueError("hours of AM and PM must be 1 to 12")
        whole = whole % 12 + (12 if parts["half"] == "p" else 0)
    return whole + minute / 60.0 + second / 3600.0, None


def _offset(zone: str | None) -> float | None:
    if zone is None or zone == "lst":
        return None
    if zone in _OFFSETS:
        return _OFFSETS[zone]
    found = re.fullmatch(r"(?:utc|gmt)?\s?([+-])(\d\d?):?(\d\d)?(?:\s*utc)?", zone)
    if not found:
        raise ValueError("a zone must be an offset or a word that is known")
    hours = int(found[2]) + int(found[3] or 0) / 60.0
    return -hours if found[1] == "-" else hours
