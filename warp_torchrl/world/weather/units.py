"""Units of weather, and their names in files."""

import re
import unicodedata

SPEEDS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "kt": 0.514444}
"""Metres a second in each unit of speed."""
Units = dict[str, tuple[float, float]]
"""Factor and offset by unit: value = factor * number + offset."""
SPEED: Units = {unit: (factor, 0.0) for unit, factor in SPEEDS.items()}
TEMPERATURE: Units = {"c": (1, 0), "f": (5 / 9, -160 / 9), "k": (1, -273.15)}
RAIN: Units = {"mm": (1, 0), "in": (25.4, 0), "cm": (10, 0), "m": (1000, 0), "in/100": (0.254, 0)}
SHARE: Units = {"%": (1, 0), "fraction": (100, 0)}
BEARING: Units = {"deg": (1, 0), "10deg": (10, 0)}
NONE: Units = {"": (1, 0)}
_WORDS = {
    "m/s": "ms mps m/sec ms-1 ms^-1 ms**-1 m*s-1 m.s-1 meters/second metres/second meter/second meterspersecond "
    "metrespersecond meters/sec",
    "km/h": "kmh kph km/hr kmhr kmph km/hour kmh-1 km.h-1 kilometers/hour kilometres/hour kilometersperhour "
    "kilometresperhour",
    "mph": "mi/h mi/hr mp/h miles/hour mile/hour milesperhour",
    "kt": "knots knot kts kn",
    "c": "degc deg_c °c degreesc degreec degreescelsius degreecelsius celsius centigrade",
    "f": "degf deg_f °f degreesf degreef degreesfahrenheit degreefahrenheit fahrenheit",
    "k": "degk kelvin kelvins",
    "mm": "millimeters millimetres millimeter millimetre kg/m2 kgm-2 kg/m^2 kgm**-2",
    "in": 'inches inch "',
    "m": "meters metres",
    "in/100": "hundredthsofinches hundredthsofaninch in*100",
    "%": "percent pct percentage percentage% per_cent",
    "fraction": "0-1 share ratio decimal proportion",
    "deg": "degrees degree ° degreestrue degtrue degt degreesn gr graus grados gradi grad",
    "10deg": "10sdeg 10'sdeg 10sdegrees tensofdegrees tensdeg",
}
_UNIT_OF = {word: unit for unit, words in _WORDS.items() for word in (unit, *words.split())}
_GLUED = sorted((word for word in _UNIT_OF if re.fullmatch("[a-z]+", word)), key=len, reverse=True)


def ascii_text(text: str) -> str:
    """Return a text in lower case without accents; degree signs stay."""
    plain = unicodedata.normalize("NFKD", text.replace("º", "°").replace("ø", "°"))
    return "".join(each for each in plain if not unicodedata.combining(each)).lower()


def unit_of(word: str) -> str | None:
    """Return the unit that a word names, None for none that is known."""
    return _UNIT_OF.get(re.sub(r"\s", "", ascii_text(word)).removesuffix("."))


def without_unit(name: str) -> list[tuple[str, str]]:
    """Return each way to part a name of letters and digits into a name and the unit at its end."""
    return [(name[: -len(word)], _UNIT_OF[word]) for word in _GLUED if name.endswith(word) and name != word]
