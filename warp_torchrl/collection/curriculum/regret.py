"""Levels at which a baseline does better than the team."""

from collections.abc import Sequence
from dataclasses import dataclass

from warp_torchrl.collection.curriculum.curriculum import Curriculum
from warp_torchrl.collection.curriculum.state import CurriculumState
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.validation import did_you_mean


@dataclass(frozen=True, kw_only=True)
class Regret(Curriculum):
    """Draws levels in proportion to the team's regret against a baseline:

        regret(level) = max(0, baseline(level) - team(level)),   share(level) = regret(level) / sum of regrets

    with the means of the measure over the baseline's ``worlds`` episodes, played before the first batch, and over the
    team's last ``episodes``; 0 for the team where these have not ended yet. Without any regret the target has all.

    Dennis et al., "Emergent Complexity and Zero-shot Transfer via Unsupervised Environment Design", 2020, use the
    regret against another policy, since the best one is unknown; here the other policy is a heuristic. Prioritized
    level replay (Jiang et al. 2021) draws levels by an estimate of regret too.

    Attributes:
        baseline: A heuristic policy.
        worlds: Number of its episodes at each level, on worlds of the training.

    Raises:
        ValueError: If a value is out of its range.
    """

    baseline: str = "local"
    worlds: int = 64

    def __post_init__(self) -> None:
        self.check(worlds=(1, 4096))
        if self.baseline not in HEURISTICS:
            hint = did_you_mean(self.baseline, list(HEURISTICS))
            raise ValueError(f"baseline must be one of {', '.join(HEURISTICS)}, got {self.baseline}{hint}")

    @property
    def asks_for(self) -> tuple[str, int] | None:
        """Return the baseline, and its number of episodes at each level."""
        return self.baseline, self.worlds

    def shares(self, state: CurriculumState) -> Sequence[float]:
        """Return each level's share of the total regret."""
        pairs = zip(state.baseline, state.judged, strict=True)
        regrets = [max(0.0, theirs - (ours or 0.0)) for theirs, ours in pairs]
        total = sum(regrets)
        return [each / total for each in regrets] if total else [0.0] * (self.n_levels - 1) + [1.0]
