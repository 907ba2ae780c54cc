"""Columns of a table of weather: names and units.

Names are read in any case, with or without accents; only their letters and digits count. A unit is stated by the file:
in the name, as in "WindSpeed (km/h)", "temperature [C]", "Temp - °F", `wind_speed_ms` and `tmpf`, or in a row of units
below it. Otherwise it is stated by the user (`units.wind_speed=km/h`), or by the documents of the file's source,
recognised by its names (`warp_torchrl.world.weather.sources`): `WS`, for example, is Canadian and so in km/h. A unit
that nobody states is an error. A height behind a name, as in `windspeed_10m`, is that of the wind's measurement; only
10 m, 20 ft and 6 m are read, and air only up to 2 m.

Bearings are in degrees from true north, the direction from which the wind blows, or points of the compass; humidity and
moistures are in per cent; the codes of the Canadian system have no unit. ISI and FWI follow from the codes and are not
read.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.weather.quantities import ASKED, OWNER, QUANTITIES, SHOWN_NAMES, STATED
from warp_torchrl.world.weather.sources import Source, find_source
from warp_torchrl.world.weather.units import SPEED, Units, ascii_text, unit_of, without_unit

_TAILS = re.compile(r"(?:set\d+d?|avg|mean|average|smp|value|hourly|horaria|horario|tot|at|agl)$")
_HEIGHT = re.compile(r"(\d{1,3})(m|ft)$")
_WIND_HEIGHTS = {"10m": "10m", "20ft": "20ft", "6m": "20ft"}
_NOTE = re.compile(
    r"\d*|\d+(?:\.\d+)?\s*(?:m|ft|min|mn|minutes?)(?: agl| above ground)?|lst|utc|gmt|local.*|avg|average|mean|hourly|"
    r"true|from|smp|inst.*|aut.?|aws|obs.*|unitless|index|none|-|lgr.*|s/n.*|dry bulb|air|decimal degrees"
)
"""What may stand in brackets and is no unit."""


@dataclass(frozen=True)
class ColumnHeader:
    """Meaning of a column's first cell."""

    text: str
    quantity: str | None  # None: nothing that is read
    name: str  # its letters and digits, without unit and height
    unit: str | None = None  # None: none is stated; a text that is no unit stands as it is
    height: str | None = None


@dataclass(frozen=True)
class Column:
    """Place of a quantity in a table, and its conversion to our unit."""

    header: str
    place: int
    unit: str
    factor: float
    offset: float
    height: str | None = None


def plain_name(text: str) -> str:
    """Return the letters and digits of a name, in lower case and without accents."""
    return re.sub(r"[^a-z0-9]", "", ascii_text(text))


def read_column_header(text: str) -> ColumnHeader:
    """Return the meaning of the text above a column."""
    name, *inside = (part.strip() for part in re.split(r"[\[\]()]", ascii_text(text)))
    unit, odd = None, [part for part in inside if not _NOTE.fullmatch(part)]
    for part in odd:
        unit = unit_of(part) or unit
    if unit is None and (tail := re.fullmatch(r"(.+)(?:,| - | in )\s*([^,]+)", name)) and unit_of(tail[2]):
        name, unit = tail[1], unit_of(tail[2])
    found, glued, height = _known(plain_name(name))
    if found is None:
        return ColumnHeader(text, None, plain_name(name))
    height = height or next(
        (part.replace(" ", "") for part in inside if _HEIGHT.fullmatch(part.replace(" ", ""))), None
    )
    unit = unit or glued or (odd[-1] if odd else None) or STATED.get(found)
    quantity = OWNER[found] if _is_at(height, OWNER[found]) else None
    if found == "wind" and unit not in SPEED:  # a word that stands for much else
        quantity = None
    return ColumnHeader(text, quantity, found, unit, height)


def _known(name: str) -> tuple[str | None, str | None, str | None]:
    """Return a column's name without unit, height and the like; then the unit and the height."""
    unit = height = None
    for _ in range(5):
        if name in OWNER:
            return name, unit, height
        glued = [(base, word) for base, word in without_unit(name) if word in _units_of(base)]
        if unit is None and glued:
            name, unit = glued[0]
        elif found := _HEIGHT.search(name):
            name, height = name[: found.start()], height or found[0]
        elif found := _TAILS.search(name):
            name = name[: found.start()]
        else:
            break
    return (name, unit, height) if name in OWNER else (None, None, None)


def _units_of(name: str) -> Units:
    """Return the units of a name; of one with a height or the like behind it, too."""
    while name and name not in OWNER and (found := _HEIGHT.search(name) or _TAILS.search(name)):
        name = name[: found.start()]
    return QUANTITIES[OWNER[name]].units if name in OWNER else {}


def _is_at(height: str | None, quantity: str) -> bool:
    """Return whether a height is one at which a quantity is read."""
    if height is None or quantity in ("wind_u", "wind_v"):
        return True
    if quantity in ("wind_speed", "wind_bearing", "wind_gust"):
        return height in _WIND_HEIGHTS
    return height in ("1m", "2m")


def stated_height(column: Column) -> str | None:
    """Return the height of the wind that a column's name states, ``10m`` or ``20ft``; None where it states none."""
    return _WIND_HEIGHTS.get(column.height or "")


def find_columns(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]] = (),
    below: Sequence[str] = (),
    given_units: Mapping[str, str] | None = None,
    asked: Collection[str] = (),
) -> tuple[dict[str, Column], Source | None]:
    """Return the column of each quantity in a table, and the source whose names it has.

    Args:
        headers: The table's first row.
        rows: The rows below it, by which names of RAWS are recognised.
        below: Units in a row below the names, empty without one.
        given_units: Units by quantity or header, given by the user.
        asked: Those of ``ASKED`` that are read.

    Raises:
        ValueError: If a quantity has two columns, no unit or one that is not known, or the wind has no column.
    """
    heads = [read_column_header(text) for text in headers]
    source = find_source([plain_name(head.text.split("(")[0].split("[")[0]) for head in heads], rows)
    if source:
        heads = [replace(head, quantity=source.names.get(head.name, head.quantity)) for head in heads]
    places = {name: _places(name, heads) for name in QUANTITIES}
    _check_wind(places, heads)
    for name in (*_unread(places), *(name for name in ASKED if name not in asked)):
        places[name] = []
    said = _said(given_units or {}, heads)
    found: dict[str, Column] = {}
    for name, at in places.items():
        usual = found["wind_speed"].unit if name == "wind_gust" and "wind_speed" in found else QUANTITIES[name].usual
        columns = [_column(name, heads[k], k, below, said, source, usual) for k in at]
        if len({(column.unit, column.height) for column in columns}) < len(columns):
            raise ValueError(f"weather must have one column of {name}, got {', '.join(headers[k] for k in at)}")
        if columns:
            found[name] = columns[0]
    return found, source


def _places(name: str, heads: Sequence[ColumnHeader]) -> list[int]:
    """Return where a quantity's columns stand: of all that there are those of the first names."""
    at = [place for place, head in enumerate(heads) if head.quantity == name]
    tiers = ([place for place in at if heads[place].name in tier] for tier in QUANTITIES[name].names)
    return next((tier for tier in tiers if tier), at)


def _unread(places: Mapping[str, list[int]]) -> list[str]:
    """Return the quantities that other quantities make redundant."""
    has_wind = places["wind_speed"] and places["wind_bearing"]
    unread = ["wind_u", "wind_v"] if has_wind else ["wind_speed", "wind_bearing"]
    return unread + ([] if places["temperature"] and not places["humidity"] else ["dew_point"])


def _check_wind(places: Mapping[str, list[int]], heads: Sequence[ColumnHeader]) -> None:
    if places["wind_u"] and places["wind_v"]:
        return
    for name in ("wind_speed", "wind_bearing"):
        if not places[name]:
            high = [head.text for head in heads if head.height and head.name in OWNER and OWNER[head.name] == name]
            why = f"; {', '.join(high)} is not the wind at 10 m or 20 ft" if high else ""
            got = ", ".join(head.text for head in heads)
            raise ValueError(f"weather must have a column of {name} ({SHOWN_NAMES[name]}), got {got}{why}")


def _said(given_units: Mapping[str, str], heads: Sequence[ColumnHeader]) -> dict[str, str]:
    """Return the user's units, by quantity.

    Raises:
        ValueError: If one names no column or no unit.
    """
    said = {}
    by_name = {plain_name(head.text): head.quantity for head in heads} | {head.name: head.quantity for head in heads}
    by_name |= {plain_name(name): name for name in QUANTITIES}
    for key, word in given_units.items():
        quantity = by_name.get(plain_name(key))
        if plain_name(key) == "datetime":
            continue
        if quantity is None:
            hint = did_you_mean(key, QUANTITIES)
            raise ValueError(f"units must name a quantity ({', '.join(QUANTITIES)}) or its column, got {key}{hint}")
        unit, known = unit_of(str(word)), QUANTITIES[quantity].units
        if unit not in known:
            raise ValueError(f"units.{key} must be {_listed(known)}, got {word}")
        said[quantity] = unit
    return said


def _column(
    name: str,
    head: ColumnHeader,
    place: int,
    below: Sequence[str],
    said: Mapping[str, str],
    source: Source | None,
    usual: str | None,
) -> Column:
    quantity = QUANTITIES[name]
    stated = [each for each in (head.unit, _below(below, place)) if each is not None]
    if name in said:  # what is no unit may be put right
        stated = [each for each in stated if each in quantity.units]
    if len(set(stated)) > 1 or (stated and name in said and said[name] != stated[0]):
        others = f"units.{name}={said[name]}" if len(set(stated)) == 1 else f"{stated[1]} in the row below it"
        raise ValueError(f"{head.text} must have one unit, it says {stated[0]} and {others}")
    unit = stated[0] if stated else said.get(name)
    unit = unit or (source.units.get(name) if source else None) or usual
    if unit is None or unit not in quantity.units:
        raise ValueError(
            f"{head.text} must name its unit ({_listed(quantity.units)}), as in {name} [{quantity.unit}], got "
            f"{unit or 'none'}: write it there, or say which by the key units.{name}"
        )
    factor, offset = quantity.units[unit]
    return Column(head.text, place, unit, factor, offset, head.height)


def _below(below: Sequence[str], place: int) -> str | None:
    """Return the unit in a row of units below the names, None where none stands there."""
    word = below[place] if below else ""
    return None if not word or _NOTE.fullmatch(ascii_text(word)) else unit_of(word) or word


def _listed(units: Units) -> str:
    return ", ".join(filter(None, units)) or "none"
