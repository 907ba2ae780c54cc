"""Statistics of episodes: means with bootstrap intervals, and paired comparisons.

Values are one number for each episode: [n] over world seeds, or [runs, n] for several training seeds. The bootstrap is
hierarchical: it resamples training seeds, then world seeds, the same ones for every policy (Agarwal et al. 2021).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

RESAMPLES = 4000


def interquartile_mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of the middle half along the last axis (Agarwal et al. 2021, as ``scipy.stats.trim_mean``)."""
    ordered = np.sort(values, axis=-1)
    cut = values.shape[-1] // 4
    return ordered[..., cut : values.shape[-1] - cut].mean(axis=-1)


def interval(values: np.ndarray, statistic: Callable[[np.ndarray], np.ndarray]) -> list[float]:
    """Return the 95 % bootstrap interval of a statistic over the last axis of values [n] or [runs, n]."""
    runs, count = np.atleast_2d(values).shape
    random = np.random.default_rng(0)
    worlds = random.integers(count, size=(RESAMPLES, 1, count))
    trained = random.integers(runs, size=(RESAMPLES, runs, 1)) if runs > 1 else np.zeros((1, 1, 1), np.int64)
    samples = np.atleast_2d(values)[trained, worlds].reshape(RESAMPLES, runs * count)
    return [float(bound) for bound in np.percentile(statistic(samples), (2.5, 97.5))]


def _mean(values: np.ndarray) -> np.ndarray:
    return values.mean(axis=-1)


def summarise(values: np.ndarray) -> dict[str, Any]:
    """Return the interquartile mean and the mean of values [n] or [runs, n], each with its 95 % interval.

    NaN in [n], an episode without a value, is dropped; the entries are None if no value is left.
    """
    values = values[~np.isnan(values)] if values.ndim == 1 else values
    if not values.size:
        return {"iqm": None, "mean": None, "ci95": None, "iqm_ci95": None}
    flat = values.reshape(-1)
    return {
        "iqm": float(interquartile_mean(flat)),
        "mean": float(flat.mean()),
        "ci95": interval(values, _mean),
        "iqm_ci95": interval(values, interquartile_mean),
    }


def compare(values: np.ndarray, other: np.ndarray, metric: str = "saved", sign: float = 1.0) -> dict[str, Any]:
    """Return the difference in a metric between two policies, paired by world, with 95 % intervals.

    Args:
        values: The metric of the policy, [n] or [runs, n].
        other: The metric of the other policy in the same worlds, [n] or [runs, n].
        metric: Its name, by which the difference is called.
        sign: -1 where less of it is better.

    Returns:
        ``saved_difference``, or that of the metric, and ``ci95``; ``probability_of_improvement``, the probability that
        a run of the policy does better in a world than a run of the other (ties count half), and ``probability_ci95``.
    """
    mine, theirs = np.atleast_2d(values), np.atleast_2d(other)
    difference = mine - theirs.mean(axis=0)
    gap = sign * (mine[:, None] - theirs[None])
    better = ((gap > 0.0) + 0.5 * (gap == 0.0)).mean(axis=1)
    return {
        f"{metric}_difference": float(difference.mean()),
        "ci95": interval(difference, _mean),
        "probability_of_improvement": float(better.mean()),
        "probability_ci95": interval(better, _mean),
    }


def performance_profile(values: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Return the share of episodes that reach each level, float64 [levels] (Agarwal et al. 2021)."""
    return (values.reshape(-1)[None] >= levels[:, None]).mean(axis=1)
