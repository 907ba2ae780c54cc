"""The configuration of evaluations."""

from dataclasses import dataclass
from typing import Literal

from warp_torchrl.runs.config.seeds import BEYOND_EVALUATION, FIRST_EVALUATED
from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """Options of evaluations.

    Attributes:
        interval: Frames between evaluations during training; 0 evaluates only at the end.
        episodes: Worlds.
        first_seed: Seed of the first; training has those below 1 000 000 and from 2^61 on.
        mode: ``sampled``, ``deterministic``, or ``best``: whichever did better on training seeds.
        leave_one_out: Play once more for each agent, without it, to see what it is worth.
        cache: Keep the baselines' episodes in ``~/.cache/warp_torchrl`` (or ``XDG_CACHE_HOME``), and read those kept.

    Raises:
        ValueError: If a value is out of its range.
    """

    interval: int = 0
    episodes: int = 256
    first_seed: int = FIRST_EVALUATED
    mode: Literal["sampled", "deterministic", "best"] = "best"
    leave_one_out: bool = False
    cache: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
        if self.interval < 0:
            raise ValueError(f"interval must be 0 or more frames, got {self.interval}")
        if not 1 <= self.episodes <= 1_000_000:
            raise ValueError(f"episodes must be in 1..1000000, got {self.episodes}")
        if not 0 <= self.first_seed <= BEYOND_EVALUATION - self.episodes:
            raise ValueError(
                f"first_seed must be in 0..{BEYOND_EVALUATION - self.episodes}, so that no episode has a training "
                f"world's seed, got {self.first_seed}"
            )
