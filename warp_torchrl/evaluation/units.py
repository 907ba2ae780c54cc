"""Numbers of metrics as tables show them, by the metric's unit."""

from typing import NamedTuple

from warp_torchrl.world.mechanics.mechanic import Metric, Unit


class Form(NamedTuple):
    """How the numbers of a unit are written."""

    factor: float  # from the metric's number to the one that is shown
    digits: str  # format without a sign
    difference: str  # what a difference of two is called


FORMS: dict[Unit, Form] = {
    "%": Form(100.0, ".1f", "points"),
    "1": Form(1.0, ".3f", ""),
    "min": Form(1.0, ".1f", "min"),
    "ha": Form(1.0, ".1f", "ha"),
    "USD": Form(1.0, ".0f", "USD"),
}
"""All units."""
_WORDS = {"saved": "forest saved", "watched": "front watched"}


def written(value: float, metric: Metric, sign: str = "") -> str:
    """Return a metric's number in its unit, without that; ``sign`` "+" writes one always."""
    form = FORMS[metric.unit]
    return f"{form.factor * value:{sign}{form.digits}}"


def told(value: float, metric: Metric) -> str:
    """Return a metric's number with its unit and its name, as in a sentence: 62.5 % saved."""
    unit = "" if metric.unit == "1" else f" {metric.unit}"
    return f"{written(value, metric)}{unit} {metric.title or metric.name}"


def headed(metric: Metric, title: str = "") -> str:
    """Return a metric's title, or another one, with its unit, as a column has it."""
    title = title or metric.title or metric.name
    return title if metric.unit == "1" else f"{title} {metric.unit}"


def in_words(metric: Metric) -> str:
    """Return what figures call a metric."""
    return _WORDS.get(metric.name, metric.name.replace("_", " "))


def on_axis(metric: Metric) -> str:
    """Return what figures call a metric, with its unit, as an axis has it."""
    return in_words(metric) if metric.unit == "1" else f"{in_words(metric)} [{metric.unit}]"


def sign_of(metric: Metric) -> float:
    """Return -1 for a metric that is better when it is less, else 1."""
    return -1.0 if metric.better == "less" else 1.0
