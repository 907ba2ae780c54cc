"""Results of a policy's evaluations in short: what a manifest keeps and a card shows."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from warp_torchrl.system.foreign_text import plain_text

_LONGEST = 400  # characters of a name
_MOST = 1000  # results, and baselines of one


@dataclass(frozen=True, kw_only=True)
class Share:
    """A mean over fires with its 95 % interval, each a share or a difference of shares.

    Attributes:
        mean: Mean.
        low: Lower end of the interval.
        high: Upper end of the interval.
    """

    mean: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A result of a policy on fires of one kind of worlds.

    Attributes:
        worlds: Scenario and overrides.
        fires: Number of fires.
        first_seed: Seed of the first fire; fire i has ``first_seed + i``.
        metric: ``saved``, the share of trees, or ``watched``, the share of the front.
        reached: Metric of the policy.
        differences: Metric of the policy minus that of a baseline on the same fires, by the baseline's name.
    """

    worlds: str
    fires: int
    first_seed: int
    metric: str
    reached: Share
    differences: Mapping[str, Share]


def of_evaluation(content: Mapping[str, Any]) -> Measured:
    """Return the result in the content of an ``evaluation.json``.

    Raises:
        KeyError, TypeError, ValueError: If it is no evaluation.
    """
    metric = content["goal"]
    versus = content["versus"] if metric == "saved" else content["watching"]
    reached, seeds = content["metrics"][metric], content["seeds"]
    found = {
        "worlds": " ".join([content["scenario"], *content["world_overrides"]]),
        "fires": len(seeds),
        "first_seed": seeds[0],
        "metric": metric,
        "reached": _share(reached["mean"], *reached["ci95"]),
        "differences": {name: _share(each[f"{metric}_difference"], *each["ci95"]) for name, each in versus.items()},
    }
    return _measured(found)


def measured_to_plain(results: tuple[Measured, ...]) -> list[dict[str, Any]]:
    """Return results as a manifest keeps them."""
    return [asdict(each) for each in results]


def measured_from_plain(content: object) -> tuple[Measured, ...]:
    """Return the results that a manifest keeps.

    Args:
        content: From a file: not trusted.

    Raises:
        KeyError, TypeError, ValueError: If they are none.
    """
    if not isinstance(content, list) or len(content) > _MOST:
        raise ValueError(f"measured must be a list of at most {_MOST}")
    return tuple(_measured(each) for each in content)


def _measured(node: Mapping[str, Any]) -> Measured:
    if node["metric"] not in ("saved", "watched") or len(node["differences"]) > _MOST:
        raise ValueError(f"a result must be of saved or watched, got {node['metric']!r:.40}")
    whole = {name: node[name] for name in ("fires", "first_seed")}
    if not all(type(each) is int and 0 <= each < 2**62 for each in whole.values()):
        raise ValueError("fires and first_seed must be whole numbers")
    return Measured(
        worlds=plain_text(node["worlds"], _LONGEST),
        metric=node["metric"],
        reached=_checked(node["reached"]),
        differences={plain_text(name, _LONGEST): _checked(each) for name, each in node["differences"].items()},
        **whole,
    )


def _checked(node: Mapping[str, Any]) -> Share:
    return Share(**_share(node["mean"], node["low"], node["high"]))


def _share(mean: object, low: object, high: object) -> dict[str, float]:
    numbers = [each for each in (mean, low, high) if isinstance(each, int | float) and isfinite(each)]
    if len(numbers) < 3:
        raise ValueError("a share must have a mean and an interval of numbers")
    return dict(zip(("mean", "low", "high"), map(float, numbers), strict=True))
