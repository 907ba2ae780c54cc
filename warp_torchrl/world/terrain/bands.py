"""Bands of a raster: the band of a layer, by number or description, and its unit."""

import re
from collections.abc import Mapping
from typing import Any

LENGTHS: Mapping[str, float] = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), 0.3048),
    **dict.fromkeys(("us-ft", "ftus", "us survey foot", "us survey feet", "foot_us", "us foot"), 1200.0 / 3937.0),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter"), 0.01),
}
"""Metres in each unit that a band or a vertical CRS may state."""
DENSITIES: Mapping[str, float] = dict.fromkeys(("kg/m3", "kg m-3", "kg/m^3", "kg m**-3"), 1.0)
"""Kilograms a cubic metre in each unit that a band may state."""
MINUTES: Mapping[str, float] = {
    **dict.fromkeys(("min", "minute", "minutes"), 1.0),
    **dict.fromkeys(("h", "hr", "hour", "hours"), 60.0),
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0 / 60.0),
}
"""Minutes in each unit of time that a band may state."""
SPEED_UNITS: Mapping[str, float] = {
    **dict.fromkeys(("m/s", "m s-1", "m s**-1", "mps", "metre/second"), 1.0),
    **dict.fromkeys(("km/h", "km h-1", "kph", "kmh"), 1.0 / 3.6),
    **dict.fromkeys(("mph", "mi/h"), 0.44704),
    **dict.fromkeys(("kt", "kts", "knot", "knots"), 1852.0 / 3600.0),
}
"""Metres a second in each unit of speed that a band may state."""
DEGREES: Mapping[str, float] = dict.fromkeys(("degree", "degrees", "deg", "°"), 1.0)
"""Units of bearings that a band may state."""
_LAYERS = {
    "fuel": r"fbfm|(?<![a-z\d])f(13|40)(?!\d)|fuel|fbp",
    "elevation": r"elev|altitude|(?<![a-z])dem(?![a-z])",
    "canopy": r"(?<![a-z])cc(?![a-z])|canopy.?cover",
    "canopy_height": r"(?<![a-z])ch(?![a-z])|canopy.?height|stand.?height",
    "canopy_base_height": r"(?<![a-z])cbh(?![a-z])|canopy.?base.?height",
    "canopy_bulk_density": r"(?<![a-z])cbd(?![a-z])|canopy.?bulk.?density",
    "age": r"(?<![a-z])age(?![a-z])",
    "assets": r"asset|worth|value",
    "arrival": r"arrival",
    "scar": r"scar|burned",
    "ignition": r"ignition",
}
"""What the description of each layer's band holds, as LANDFIRE (US_230FBFM40, LC22_CC_230) and FlamMap write it."""
_VERTICAL = re.compile(r'VERT(?:_CS|CRS|ICALCRS)\[.*?UNIT\["[^"]*",\s*([\d.eE+-]+)', re.DOTALL)


def choose_band(name: str, path: object, layer: Any, wanted: int | str | None, key: str) -> int:
    """Return the number of a layer's band, from 1, in an open raster.

    Args:
        name: What the layer is: a key of ``_LAYERS`` is looked for among the descriptions.
        path: The file, for messages.
        layer: An open dataset.
        wanted: The band's number or description; None looks for the only one, or the one that is described so.
        key: How the user chooses, for messages.

    Raises:
        ValueError: If it is none, or several, with the names of all.
    """
    bands = [number for number in range(1, layer.count + 1) if layer.colorinterp[number - 1].name != "alpha"]
    if wanted is not None:
        asked = str(wanted).strip().lower()
        bands = [number for number in bands if asked in (str(number), _description(layer, number).lower())]
    elif len(bands) > 1:
        words = _LAYERS.get(name.removesuffix(".path"), "$.")
        bands = [number for number in bands if re.search(words, _description(layer, number), re.IGNORECASE)]
    if len(bands) != 1:
        asked = "" if wanted is None else f"; {wanted!r} names {len(bands)} of them"
        raise ValueError(f"{name} must have one band of real numbers, {path} has {_all(layer)}{asked}; {key}")
    return bands[0]


def band_names(layer: Any) -> list[str]:
    """Return the description of each band of an open raster, its number where it has none."""
    return [_description(layer, number) or str(number) for number in range(1, layer.count + 1)]


def band_unit(layer: Any, number: int) -> str:
    """Return the unit of a band of an open raster, in lower case, or of its vertical CRS; else nothing."""
    stated = str(layer.units[number - 1] or "").strip().lower()
    vertical = _VERTICAL.search(layer.crs.to_wkt()) if layer.crs and not stated else None
    if vertical is None:
        return stated
    metres = float(vertical[1])
    return next((unit for unit, length in LENGTHS.items() if abs(length / metres - 1.0) < 1e-9), f"{metres:g} m")


def factor_of(name: str, path: object, unit: str, units: Mapping[str, float], given: float | None = None) -> float:
    """Return the factor of a stated unit, 1 without one; the user's unit must be the same.

    Raises:
        ValueError: If the unit is not known, or contradicts what is given.
    """
    if not unit:
        return 1.0 if given is None else given
    if unit not in units:
        raise ValueError(f"{name} must be in {', '.join(units)}, {path} states {unit!r}")
    if given is not None and abs(given / units[unit] - 1.0) > 1e-5:
        raise ValueError(f"{name}_unit must be that of {path}, which states {unit!r}, {units[unit]:g}, got {given:g}")
    return units[unit]


def _description(layer: Any, number: int) -> str:
    return str(layer.descriptions[number - 1] or "").strip()


def _all(layer: Any) -> str:
    shown = [
        f"{number} ({_description(layer, number) or layer.dtypes[number - 1]})" for number in range(1, layer.count + 1)
    ]
    return ", ".join(shown[:12]) + ", ..." * (len(shown) > 12)
