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


def written(value: float, metric: Metric, sign: str = "") -> str:
    """Return a metric's number in its unit, without that; ``sign`` "+" writes one always."""
    form = FORMS[metric.unit]
    return f"{form.factor * value:{sign}{form.digits}}"


def headed(metric: Metric, title: str = "") -> str:
    """Return a metric's title, or another one, with its unit, as a column has it."""
    title = title or metric.title or metric.name
    return title if metric.unit == "1" else f"{title} {metric.unit}"


def sign_of(metric: Metric) -> float:
    """Return -1 for a metric that is better when it is less, else 1."""
    return -1.0 if metric.better == "less" else 1.0
