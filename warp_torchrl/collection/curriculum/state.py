"""State of a curriculum: the team's results at each level."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

_LISTS = ("counts", "sums", "judged", "baseline")


@dataclass(frozen=True, kw_only=True)
class CurriculumState:
    """The team's results at the L levels of a curriculum, easy to hard.

    A level is judged by groups of episodes: when one is full, its mean is kept and the next one begins.

    Attributes:
        counts: Episodes in the open group of each level.
        sums: Sums of the measure over them.
        judged: Mean of the last full group of each level; None before the first.
        baseline: Mean of a baseline's measure at each level; empty if the rule uses none.
        level: Index of the present level; for rules that learn one level at a time.
    """

    counts: tuple[float, ...]
    sums: tuple[float, ...]
    judged: tuple[float | None, ...]
    baseline: tuple[float, ...] = ()
    level: int = 0

    @classmethod
    def first(cls, n_levels: int, baseline: Sequence[float] = ()) -> "CurriculumState":
        """Return the state before the first episode."""
        none = (0.0,) * n_levels
        return cls(counts=none, sums=none, judged=(None,) * n_levels, baseline=tuple(baseline))

    def after(self, counts: Sequence[float], sums: Sequence[float], group: int) -> "CurriculumState":
        """Add episodes that ended.

        Args:
            counts: Of each level.
            sums: Of the measure over them.
            group: Episodes of a full group, at least.
        """
        now = [
            (n + more, total + its) for n, more, total, its in zip(self.counts, counts, self.sums, sums, strict=True)
        ]
        full = {level for level, (n, _) in enumerate(now) if n >= group}
        judged = [now[at][1] / now[at][0] if at in full else known for at, known in enumerate(self.judged)]
        open_ = [(0.0, 0.0) if at in full else each for at, each in enumerate(now)]
        counts, sums = zip(*open_, strict=True)
        return replace(self, counts=counts, sums=sums, judged=tuple(judged))

    def at(self, level: int) -> "CurriculumState":
        """Return the same state at another level, whose results are empty."""

        def with_value(values: Sequence[Any], value: float | None) -> tuple[Any, ...]:
            return (*values[:level], value, *values[level + 1 :])

        counts, sums = with_value(self.counts, 0.0), with_value(self.sums, 0.0)
        return replace(self, counts=counts, sums=sums, judged=with_value(self.judged, None), level=level)

    def state_dict(self) -> dict[str, Any]:
        """Return the state as plain values."""
        return {name: list(getattr(self, name)) for name in _LISTS} | {"level": self.level}

    @classmethod
    def of(cls, state: Mapping[str, Any]) -> "CurriculumState":
        """Return the state of a ``state_dict``."""
        lists = {name: tuple(state[name]) for name in _LISTS}
        return cls(level=int(state["level"]), **lists)


def episodes_by_level(level: Tensor, done: Tensor, measure: Tensor, n_levels: int) -> Tensor:
    """Return how many episodes ended at each level, and the sum of a measure over them, float64 [2, L].

    Args:
        level: Of each step's world, int64 [...].
        done: Whether the episode ended with it, bool [...].
        measure: Of the episode so far, float32 [...].
        n_levels: L.
    """
    ended = torch.stack((done.double(), torch.where(done, measure, 0.0).double())).flatten(1)
    return ended.new_zeros(2, n_levels).index_add_(1, level.flatten(), ended)
