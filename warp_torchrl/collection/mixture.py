"""Mixtures: several scenarios in one training, each with a share of the worlds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.validation import check_fields, did_you_mean


@dataclass(frozen=True, kw_only=True)
class NoMixture:
    """All worlds are of the run's scenario."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of worlds of a mixture.

    Attributes:
        scenario: One of ``conf/scenario``.
        over: Keys of its worlds that have other values: ``{team: {n_agents: 2}, wind: wandering, wind.speed: 8}``.
        share: Share of the worlds, in proportion to the shares of the others.
        teacher: Teacher of its worlds; None takes ``imitation.teacher``.
        teacher_weight: Factor on ``imitation.weight`` and ``weight_end`` in its worlds.

    Raises:
        ValueError: If the share or the weight is out of its range.
    """

    scenario: str
    over: Mapping[str, Any] = field(default_factory=dict)
    share: float = 1.0
    teacher: str | None = None
    teacher_weight: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, share=(1e-6, 1e6), teacher_weight=(0.0, 1e6))


@dataclass(frozen=True, kw_only=True)
class Mixture:
    """Several kinds of worlds, from which one team learns.

    Attributes:
        kinds: By name, each with the fields of ``Kind``; the scenario is that of the name where it is left out.
        weigh: Weight of each kind's loss: its ``share`` of the worlds, or what is ``left`` to learn, see ``weights``.
        baseline: The heuristic whose results define what is left to learn.
        worlds: Number of worlds of each kind that the baseline plays before the training.
        floor: Least of what is left; a kind that is learned keeps it.

    Raises:
        ValueError: If a value is out of its range, or the baseline is unknown.
    """

    kinds: Mapping[str, Any] = field(default_factory=dict)
    weigh: Literal["share", "left"] = "share"
    baseline: str = "coordinated"
    worlds: int = 64
    floor: float = 0.25

    def __post_init__(self) -> None:
        check_fields(self, worlds=(1, 100_000), floor=(1e-6, 1e6))
        if self.baseline not in HEURISTICS:
            hint = did_you_mean(self.baseline, list(HEURISTICS))
            raise ValueError(f"baseline must be one of {', '.join(HEURISTICS)}, got {self.baseline}{hint}")


def weights(
    shares: Sequence[float], saved: Sequence[float | None], baseline: Sequence[float], floor: float
) -> list[float]:
    """Return the weight of each kind's loss, from what is left to learn.

        w_k = share_k left_k / sum_j share_j left_j,   left_k = floor + max(0, 1 - saved_k / baseline_k)

    Args:
        shares: Shares of the worlds, by kind.
        saved: Shares of trees that the team saves; None where no episode has ended yet, which counts as 0.
        baseline: Shares of trees that the baseline saves.
        floor: Least of what is left.
    """
    left = [floor + max(0.0, 1.0 - (its or 0.0) / max(best, 1e-6)) for its, best in zip(saved, baseline, strict=True)]
    whole = sum(share * its for share, its in zip(shares, left, strict=True))
    return [share * its / whole for share, its in zip(shares, left, strict=True)]


def worlds_by_share(shares: Sequence[float], count: int) -> list[int]:
    """Return the number of worlds of each share: one at least, and the rest by largest remainder.

    Raises:
        ValueError: If there are fewer worlds than shares.
    """
    if count < len(shares):
        raise ValueError(f"n_worlds must be at least {len(shares)}, one for each kind of the mixture, got {count}")
    quotas = [share / sum(shares) * count for share in shares]
    given = [max(1, int(quota)) for quota in quotas]
    while sum(given) < count:
        at = max(range(len(quotas)), key=lambda i: quotas[i] - given[i])
        given[at] += 1
    while sum(given) > count:  # the small ones have one each: the largest give
        at = min((i for i in range(len(quotas)) if given[i] > 1), key=lambda i: quotas[i] - given[i])
        given[at] -= 1
    return given
