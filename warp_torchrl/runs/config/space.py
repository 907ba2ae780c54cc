"""Search space: keys of a configuration with several values, in the grammar of Hydra's sweeps.

``interval(0.9, 0.99)`` is a float, ``int(interval(16, 128))`` a whole number, ``range(1, 9)`` one of its numbers, and
``choice(tanh, relu)`` or ``tanh,relu`` one of any values. ``tag(log, ...)`` searches an interval by its logarithm.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, IntervalSweep, RangeSweep
from hydra.errors import HydraException

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.grammar import check_overrides

Value = str | int | float
"""A value as a search draws it; of a choice its text in Hydra's grammar."""


@dataclass(frozen=True, kw_only=True)
class Dimension:
    """A key that is searched.

    Attributes:
        key: Key of the configuration.
        text: Its values, in Hydra's grammar.
        choices: Texts of the values, without an interval or range.
        low: The lowest.
        high: The highest.
        step: Between values; None for any between the two.
        log: Whether it is searched by its logarithm.
        is_whole: Whether its values are whole numbers.

    Raises:
        ConfigError: If there are fewer than two values, or ``log`` is set without an interval above 0.
    """

    key: str
    text: str
    choices: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 0.0
    step: float | None = None
    log: bool = False
    is_whole: bool = False

    def __post_init__(self) -> None:
        if len(set(self.choices)) < len(self.choices):
            raise ConfigError(f"{self.key} must have each choice once, got {self.text}")
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise ConfigError(f"{self.key} must be searched between finite numbers, got {self.text}")
        if len(self.choices) == 1 or (not self.choices and self.low >= self.high):
            raise ConfigError(f"{self.key} must have two values at least, from low to high, got {self.text}")
        steps = self.step is not None and not (self.is_whole and self.step == 1)
        if self.log and (self.choices or self.low <= 0 or steps):
            raise ConfigError(f"{self.key} must be in an interval above 0 to be searched by logarithm, got {self.text}")

    def ends(self) -> tuple[Value, ...]:
        """Return the values that are checked before a search begins: every choice, or the lowest and the highest."""
        return self.choices or (self.low, self.high)

    def override(self, value: Value) -> str:
        """Return the override that gives the key a value."""
        return f"{self.key}={value}"

    def holding(self, value: Any) -> Value | None:
        """Return a configuration's value as one of this dimension's; None if it is another."""
        if self.choices:
            return next((each for each in self.choices if _same(value_of(self.override(each)), value)), None)
        if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
            return None
        steps = 0.0 if self.step is None else (value - self.low) / self.step
        if (self.is_whole and value != int(value)) or abs(steps - round(steps)) > 1e-9:
            return None
        return int(value) if self.is_whole else float(value)


def _same(one: Any, other: Any) -> bool:
    return one == other and isinstance(one, bool) == isinstance(other, bool)


def divided(
    overrides: Sequence[str], searched: Mapping[str, str], fixed: Sequence[str]
) -> tuple[list[Dimension], list[str]]:
    """Divide the overrides of a search into its dimensions and the overrides that are the same in all trainings.

    Args:
        overrides: Of the command line; an override with several values is searched.
        searched: Of a ready search, values by key; a key of the command line's is its.
        fixed: Overrides of a ready search; the same.

    Raises:
        ConfigError: If an override is not of Hydra's grammar, or has several values that no search can draw from.
    """
    given = {override.partition("=")[0]: override for override in overrides}
    ready = [each for each in fixed if each.partition("=")[0] not in given]
    told = [*ready, *(f"{key}={text}" for key, text in searched.items() if key not in given), *overrides]
    check_overrides(told)
    found = [(each, dimension(each)) for each in told]
    return [each for _, each in found if each is not None], [each for each, several in found if several is None]


def dimension(override: str) -> Dimension | None:
    """Return the dimension of an override in Hydra's grammar; None if it has one value.

    Raises:
        ConfigError: If it has several that no search can draw from.
    """
    parsed = OverridesParser.create().parse_override(override)
    if not parsed.is_sweep_override():
        return None
    key, _, text = override.partition("=")
    values = parsed.value()
    if isinstance(values, ChoiceSweep):
        return Dimension(key=key, text=text, choices=tuple(parsed.sweep_string_iterator()), log="log" in values.tags)
    if isinstance(values, IntervalSweep) and values.start is not None and values.end is not None:
        is_whole = isinstance(values.start, int)
        return Dimension(
            key=key, text=text, low=values.start, high=values.end, log="log" in values.tags, is_whole=is_whole
        )
    if isinstance(values, RangeSweep) and values.start is not None and values.stop is not None and values.step > 0:
        numbers = list(parsed.sweep_string_iterator())  # without the stop, as in a sweep
        last = len(numbers) - 1
        return Dimension(
            key=key,
            text=text,
            low=values.start,
            high=values.start + max(last, 0) * values.step,
            step=values.step,
            log="log" in values.tags,
            is_whole=all(isinstance(each, int) for each in (values.start, values.step)),
        )
    raise ConfigError(f"{key} must be an interval, a range or choices to be searched, got {text}")


def value_of(override: str) -> Any:
    """Return the value of an override in Hydra's grammar, as a yaml file has it.

    Raises:
        ConfigError: If it cannot be read.
    """
    try:
        return OverridesParser.create().parse_override(override).value()
    except HydraException as error:
        raise ConfigError(" ".join(str(error).split())) from None
