"""Mixtures: several scenarios in one training, each with a share of the worlds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class NoMixture:
    """All worlds are of the run's scenario."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of worlds of a mixture.

    Attributes:
        scenario: One of ``conf/scenario``.
        over: Keys of its worlds that have other values: ``{team: {n_agents: 2}, wind: wandering}``.
        share: Of the worlds, in proportion to the shares of the others.
        teacher: The heuristic that labels its worlds, in place of ``imitation.teacher``; None takes that one.

    Raises:
        ValueError: If the share is out of its range.
    """

    scenario: str
    over: Mapping[str, Any] = field(default_factory=dict)
    share: float = 1.0
    teacher: str | None = None

    def __post_init__(self) -> None:
        check_fields(self, share=(1e-6, 1e6))


@dataclass(frozen=True, kw_only=True)
class Mixture:
    """Several kinds of worlds, from which one team learns.

    Attributes:
        kinds: By name, each with the fields of ``Kind``; the scenario is that of the name where it is left out.
    """

    kinds: Mapping[str, Any] = field(default_factory=dict)


def apportioned(shares: Sequence[float], count: int) -> list[int]:
    """Return how many of so many worlds each of the shares has: one at least, and the largest remainders the rest.

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
