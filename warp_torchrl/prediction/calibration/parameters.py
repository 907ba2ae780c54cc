"""Parameters of law ``rate`` that can be fitted: their bounds, their priors, and the law at given values.

A fit moves z, one number for each parameter, whose prior is normal with mean 0 and deviation 1:

    gain or deviation = usual exp(scale z),    moisture = usual + scale z

The usual value is that of the law from which the fit starts. Where the fires say nothing about a parameter, it keeps
its usual value.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from torch import Tensor

from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.law.rate import RateFire

GAINS = ("rate_gain", "wind_gain", "slope_gain")
DEVIATIONS = ("cell_deviation", "fire_deviation")
_GAIN = (0.2, 5.0, 0.3)  # lowest, highest, scale of the logarithm: two thirds of fires within 0.74 and 1.35
_DEVIATION = (0.02, 1.0, 0.5)
_DEAD, _LIVE = (1.0, 60.0, 2.0), (30.0, 300.0, 30.0)
_MOISTURE = {"ffmc": (50.0, 100.0, 3.0), "bui": (1.0, 300.0, 20.0), "live_herbaceous": _LIVE, "live_woody": _LIVE}
_HUGE = 1e30  # no bound and no scale is as large


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter that is fitted.

    Attributes:
        name: ``rate_gain``, ``wind_gain``, ``slope_gain``, ``fuel_gain.CODE``, ``moisture.NAME``, ``cell_deviation`` or
            ``fire_deviation``, as keys of ``RateFire`` are.
        low: Lowest value.
        high: Highest value.
        scale: Deviation of its prior: of the logarithm, but of the value itself for a moisture [its unit].

    Raises:
        ValueError: If the law has no such parameter, or the bounds or the scale are out of order.
    """

    name: str
    low: float
    high: float
    scale: float

    def __post_init__(self) -> None:
        if not 0.0 < self.low < self.high:
            raise ValueError(f"bounds.{self.name} must be over 0, from low to high, got {[self.low, self.high]}")
        if not 0.0 < self.scale < math.inf:
            raise ValueError(f"scales.{self.name} must be over 0, got {self.scale}")

    @property
    def is_log(self) -> bool:
        """Return whether its logarithm is what moves."""
        return not self.name.startswith("moisture.")

    def usual(self, fire: RateFire) -> float:
        """Return the value that a law has."""
        group, _, member = self.name.partition(".")
        if group == "moisture":
            return float(fire.moisture.get(member, MOISTURES[member]))
        if group == "fuel_gain":
            return float({str(code): gain for code, gain in fire.fuel_gain.items()}.get(member, 1.0))
        return float(getattr(fire, group))

    def value(self, usual: float, z: float) -> float:
        """Return the value at z, inside the bounds."""
        moved = usual * math.exp(self.scale * z) if self.is_log else usual + self.scale * z
        return min(self.high, max(self.low, moved))

    def limits(self, usual: float) -> tuple[float, float]:
        """Return z at both bounds."""
        if self.is_log:
            return math.log(self.low / usual) / self.scale, math.log(self.high / usual) / self.scale
        return (self.low - usual) / self.scale, (self.high - usual) / self.scale


def parameter(name: str, bounds: Sequence[float] | None = None, scale: float | None = None) -> Parameter:
    """Return a parameter by its name, with the bounds and the prior that are usual where none are given.

    Raises:
        ValueError: If the law has no such parameter, or a value is out of order.
    """
    low, high, usual_scale = _usual(str(name))
    if bounds is not None:
        if not isinstance(bounds, list | tuple) or len(bounds) != 2:
            raise ValueError(f"bounds.{name} must be a pair from low to high, got {bounds!r}")
        low, high = (_number(f"bounds.{name}", bound) for bound in bounds)
    return Parameter(
        name=str(name),
        low=low,
        high=high,
        scale=usual_scale if scale is None else _number(f"scales.{name}", scale),
    )


def parameters_of(
    names: Sequence[str],
    fire: RateFire,
    bounds: Mapping[str, Sequence[float]] | None = None,
    scales: Mapping[str, float] | None = None,
) -> tuple[Parameter, ...]:
    """Return parameters by name, for a law that the fit starts from.

    Raises:
        ValueError: If a name is not known or comes twice, bounds or scales name another, or the law's own value is not
            inside the bounds.
    """
    bounds, scales = dict(bounds or {}), dict(scales or {})
    for key, given in (("bounds", bounds), ("scales", scales)):
        for name in given:
            if name not in names:
                raise ValueError(f"{key} must name parameters that are fitted, got {name}{did_you_mean(name, names)}")
    if len(set(names)) < len(names):
        raise ValueError(f"parameters must each be named once, got {', '.join(names)}")
    made = tuple(parameter(name, bounds.get(name), scales.get(name)) for name in names)
    for each in made:
        usual = each.usual(fire)
        if not each.low <= usual <= each.high:
            raise ValueError(f"fire.{each.name} must be in its bounds, [{each.low:g}, {each.high:g}], got {usual:g}")
    return made


def fire_at(fire: RateFire, parameters: Sequence[Parameter], z: Tensor) -> RateFire:
    """Return the law with its parameters at z, float [P]."""
    gains, moisture = {int(code): gain for code, gain in fire.fuel_gain.items()}, dict(fire.moisture)
    plain: dict[str, float] = {}
    for each, moved in zip(parameters, z.tolist(), strict=True):
        group, _, member = each.name.partition(".")
        value = each.value(each.usual(fire), moved)
        if group == "fuel_gain":
            gains[int(member)] = value
        elif group == "moisture":
            moisture[member] = value
        else:
            plain[group] = value
    return replace(fire, fuel_gain=gains, moisture=moisture, **plain)  # type: ignore[arg-type]


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not -_HUGE < value < _HUGE:
        raise ValueError(f"{key} must be a finite number, got {value!r}")
    return float(value)


def _usual(name: str) -> tuple[float, float, float]:
    group, _, member = name.partition(".")
    if name in GAINS or (group == "fuel_gain" and member.isdigit()):
        return _GAIN
    if name in DEVIATIONS:
        return _DEVIATION
    if group == "moisture" and member in MOISTURES:
        return _MOISTURE.get(member, _DEAD)
    known = [*GAINS, *DEVIATIONS, *(f"moisture.{each}" for each in MOISTURES), "fuel_gain.CODE"]
    raise ValueError(f"parameters must be of {', '.join(known)}, got {name}{did_you_mean(name, known)}")
