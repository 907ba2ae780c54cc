"""Which columns of a table of weather are read, by what names, and in what units.

Names are read in any case; spaces and hyphens in them do not count. A unit stands behind the name, in brackets as in
"WindSpeed (km/h)" and "temperature [C]", or as a suffix as in `wind_speed_ms` and `temperature_c`. Without one, the
name of the wind speed says whose file it is:

    wind speed       Canadian `ws` km/h          RAWS `windspeed`, `windspd` mph    ours `wind_speed` with its unit
    temperature      C                           F                                  with its unit
    rain             mm                          in                                 with its unit

Other names are: `wd`, `winddirection`, `winddir`, `wind_direction`, `wind_dir`, `wind_bearing`; `tmp`, `temp`,
`temperature`; `rh`, `humidity`, `relativehumidity`, `relative_humidity`; `apcp`, `prec`, `precip`, `precipitation`,
`hrlypcp`, `rain`; `ffmc`, `dmc`, `dc`, `bui`; `dead_1h`, `dead_10h`, `dead_100h`, `live_herbaceous`, `live_woody`.
Units are m/s, km/h, mph, kt; C, F, K; mm, in; and their usual other spellings.

Bearings are in degrees from true north, where the wind comes from; humidity and moistures are in per cent; the codes of
the Canadian system have no unit. Other columns are left unread; so are ISI and FWI, which follow from the codes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

SPEEDS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "kt": 0.514444}
"""Metres a second in each unit of speed."""
_WORDS = {
    **{"ms": "m/s", "mps": "m/s", "kmh": "km/h", "kph": "km/h", "km/hr": "km/h", "mi/h": "mph", "knots": "kt"},
    **{"kts": "kt", "degc": "c", "°c": "c", "celsius": "c", "degf": "f", "°f": "f", "fahrenheit": "f"},
    **{"inches": "in", "percent": "%", "pct": "%", "degrees": "deg", "°": "deg"},
}
"""Other words for a unit."""


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One thing that a table may tell: value = factor * number + offset."""

    names: tuple[str, ...]
    lowest: float
    highest: float
    unit: str  # ours
    units: dict[str, tuple[float, float]]  # factor and offset by unit
    usual: tuple[str, str]  # without a unit: in a Canadian file and in one of RAWS; any file where they are the same


def _plain(names: str, lowest: float, highest: float, unit: str = "") -> Quantity:
    return Quantity(
        names=tuple(names.split()),
        lowest=lowest,
        highest=highest,
        unit=unit,
        units={unit: (1, 0)},
        usual=(unit, unit),
    )


QUANTITIES = {
    "wind_speed": Quantity(
        names=("ws", "windspeed", "windspd", "wind_speed"),
        lowest=0,
        highest=100,
        unit="m/s",
        units={unit: (factor, 0.0) for unit, factor in SPEEDS.items()},
        usual=("km/h", "mph"),
    ),
    "wind_bearing": _plain("wd winddirection winddir wind_direction wind_dir wind_bearing", 0, 360, "deg"),
    "temperature": Quantity(
        names=("tmp", "temp", "temperature"),
        lowest=-60,
        highest=60,
        unit="c",
        units={"c": (1, 0), "f": (5 / 9, -160 / 9), "k": (1, -273.15)},
        usual=("c", "f"),
    ),
    "humidity": _plain("rh humidity relativehumidity relative_humidity", 0, 100, "%"),
    "rain": Quantity(
        names=("apcp", "prec", "precip", "precipitation", "hrlypcp", "rain"),
        lowest=0,
        highest=500,
        unit="mm",
        units={"mm": (1, 0), "in": (25.4, 0)},
        usual=("mm", "in"),
    ),
    "ffmc": _plain("ffmc", 0, 101),
    "dmc": _plain("dmc", 0, 2000),
    "dc": _plain("dc", 0, 5000),
    "bui": _plain("bui", 0, 2000),
    **{name: _plain(name, 0, 400, "%") for name in ("dead_1h", "dead_10h", "dead_100h")},
    **{name: _plain(name, 0, 600, "%") for name in ("live_herbaceous", "live_woody")},
}
"""Every quantity that is read, by the name of its field."""


@dataclass(frozen=True)
class Column:
    """Where a quantity stands in a table, and how its numbers become values in our unit."""

    header: str
    place: int
    unit: str
    factor: float
    offset: float


def find_columns(headers: Sequence[str]) -> dict[str, Column]:
    """Return the column of each quantity that a table has.

    Args:
        headers: The table's first row.

    Raises:
        ValueError: If a quantity has two columns, no unit or one that is not known, or the wind has no column.
    """
    places = {name: _places(name, headers) for name in QUANTITIES}
    for name in ("wind_speed", "wind_bearing"):
        if not places[name]:
            known = ", ".join(QUANTITIES[name].names)
            raise ValueError(f"weather must have a column of {name} ({known}), got {', '.join(headers)}")
    for name, found in places.items():
        if len(found) > 1:
            raise ValueError(f"weather must have one column of {name}, got {', '.join(headers[k] for k in found)}")
    file = _split(headers[places["wind_speed"][0]])[0]
    family = {"ws": 0, "windspeed": 1, "windspd": 1}.get(file)
    return {name: _column(name, headers[found[0]], found[0], family) for name, found in places.items() if found}


def _places(name: str, headers: Sequence[str]) -> list[int]:
    return [place for place, header in enumerate(headers) if _split(header)[0] in QUANTITIES[name].names]


def _column(name: str, header: str, place: int, family: int | None) -> Column:
    quantity = QUANTITIES[name]
    unit = _split(header)[1]
    if unit is None and len(set(quantity.usual)) == 1:
        unit = quantity.usual[0]
    elif unit is None and family is not None:
        unit = quantity.usual[family]
    if unit is None or unit not in quantity.units:
        known = ", ".join(filter(None, quantity.units)) or "none"
        raise ValueError(f"{header} must name its unit ({known}), as in {name} [{quantity.unit}], got {unit or 'none'}")
    factor, offset = quantity.units[unit]
    return Column(header=header, place=place, unit=unit, factor=factor, offset=offset)


def _split(header: str) -> tuple[str, str | None]:
    """Return a header's name and the unit in it, None where it has none."""
    text = re.sub(r"[\s-]", "", header.lower())
    if bracketed := re.fullmatch(r"(.+?)_?[\[(](.*)[\])]", text):
        return bracketed[1], _WORDS.get(bracketed[2], bracketed[2])
    name, _, suffix = text.rpartition("_")
    unit = _WORDS.get(suffix, suffix)
    if name and any(name in each.names and unit in each.units for each in QUANTITIES.values()):
        return name, unit
    return text, None
