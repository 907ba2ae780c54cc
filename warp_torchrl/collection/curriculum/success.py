"""Levels of intermediate difficulty, one at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

from warp_torchrl.collection.curriculum.curriculum import Curriculum
from warp_torchrl.collection.curriculum.state import CurriculumState


@dataclass(frozen=True, kw_only=True)
class Success(Curriculum):
    """Learns the level at which success lies between two bounds.

    It starts at the easiest level. Each time that ``episodes`` have ended at the level, with mean success S:

        S > high: the next harder level;   S < low: the next easier one;   else the same again.

    Success between bounds marks a goal of intermediate difficulty (Florensa et al., "Automatic Goal Generation for
    Reinforcement Learning Agents", 2018). Judging a level by a buffer of episodes against two thresholds, and emptying
    it, is automatic domain randomization (OpenAI, "Solving Rubik's Cube with a Robot Hand", 2019, algorithm 1).

    Attributes:
        low: Lower bound of success.
        high: Upper bound.

    Raises:
        ValueError: If a value is out of its range, or ``low`` is not below ``high``.
    """

    low: float = 0.2
    high: float = 0.6

    def __post_init__(self) -> None:
        self.check(low=(0.0, 1.0), high=(0.0, 1.0))
        if self.low >= self.high:
            raise ValueError(f"low must be below high, {self.high}, got {self.low}")

    def shares(self, state: CurriculumState) -> Sequence[float]:
        """Return 1 at the present level."""
        return [float(level == state.level) for level in range(self.n_levels)]

    def after(self, state: CurriculumState, counts: Sequence[float], sums: Sequence[float]) -> CurriculumState:
        """Return the state after episodes that ended: at another level, if the present one is too easy or too hard."""
        now = super().after(state, counts, sums)
        success = now.judged[now.level]  # of the last full group since the level was entered, which kept it
        if success is None:
            return now
        step = int(success > self.high) - int(success < self.low)
        level = min(max(now.level + step, 0), self.n_levels - 1)
        return now if level == now.level else now.at(level)
