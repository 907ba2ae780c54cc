"""Base of automatic curricula: levels, and the share of episodes of the target."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from warp_torchrl.collection.curriculum.state import CurriculumState
from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class NoCurriculum:
    """Every episode is of the scenario itself."""


@dataclass(frozen=True, kw_only=True)
class Curriculum:
    """Base of the rules. The last of L levels is the scenario itself, the target.

    Each episode draws its level when it starts:

        P(level) = floor [level is the target] + (1 - floor) share(level)

    and from ``until`` on every episode is of the target. Portelas et al., "Automatic Curriculum Learning for Deep RL: A
    Short Survey", 2020, has the field.

    Attributes:
        over: Keys of the scenario, as the configuration has them, with a list of L values each, easy to hard:
            ``{steps_per_tick: [20, 10, 5], ignition: {count: [1, 1, 2]}}``. The last is the scenario's own.
        measure: Result of an episode: ``saved``, the share of trees, or ``success``, 1 where the fire is out and enough
            is saved.
        episodes: Episodes that must end at a level, at least, before it is judged by their mean.
        floor: Share of episodes that is always of the target.
        until: Share of the training after which every episode is of the target.

    Raises:
        ValueError: If a value is out of its range, or ``over`` is no such lists.
    """

    over: Mapping[str, Any] = field(default_factory=dict)
    measure: Literal["saved", "success"] = "saved"
    episodes: int = 128
    floor: float = 0.1
    until: float = 0.75

    def __post_init__(self) -> None:
        self.check()

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, further fields against ``ranges``, and the lists."""
        check_fields(self, episodes=(1, 1_000_000), floor=(0.0, 1.0), until=(0.0, 1.0), **ranges)
        lists = self.values()
        for key, values in lists.items():
            if not isinstance(values, list | tuple) or len(values) < 2:
                raise ValueError(f"over.{key} must be a list of values, easy to hard, got {values!r}")
        lengths = {key: len(values) for key, values in lists.items()}
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{key} {length}" for key, length in lengths.items())
            raise ValueError(f"over must have as many values of each key, got {told}")

    def values(self) -> dict[str, Any]:
        """Return the values of each level by dotted key."""
        return dict(_leaves(self.over))

    @property
    def asks_for(self) -> tuple[str, int] | None:
        """Return the baseline of the rule, and its number of episodes at each level; None without one."""
        return None

    @property
    def n_levels(self) -> int:
        """Return L; 1 where there are no lists."""
        return len(next(iter(self.values().values()), [None]))

    def chances(self, state: CurriculumState, progress: float) -> tuple[float, ...]:
        """Return the chance of each level for the next episodes, at progress in 0..1."""
        target = [0.0] * (self.n_levels - 1) + [1.0]
        if progress >= self.until:
            return tuple(target)
        shares = self.shares(state)
        return tuple(
            self.floor * is_target + (1.0 - self.floor) * share for is_target, share in zip(target, shares, strict=True)
        )

    def after(self, state: CurriculumState, counts: Sequence[float], sums: Sequence[float]) -> CurriculumState:
        """Return the state after episodes that ended, ``counts`` at each level with ``sums`` of the measure."""
        return state.after(counts, sums, self.episodes)

    def shares(self, state: CurriculumState) -> Sequence[float]:
        """Return the share of each level in the episodes outside of the floor; they add up to 1."""
        raise TypeError(f"{type(self).__name__} does not say what it draws: define shares()")


def _leaves(node: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, value in node.items():
        if "." in str(key):
            head, _, rest = str(key).partition(".")
            raise ValueError(f"over must name {key} as {{{head}: {{{rest}: [...]}}}}, or be given as over.{key}=[...]")
        path = f"{prefix}{key}"
        found += _leaves(value, f"{path}.") if isinstance(value, Mapping) else [(path, value)]
    return found
