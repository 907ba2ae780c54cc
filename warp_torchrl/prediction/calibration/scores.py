"""Agreement of a predicted with an observed fire.

A and S are sets of cells: the cells predicted to burn, and the scar.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.law.travel import NEVER

BURNS = 0.5
"""Least burn probability of a cell that is told to burn."""


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Agreement of one map of fires with one scar; None where no comparison is possible.

    Attributes:
        jaccard_at_area: |A and S| / |A or S|, where A holds the first cells to burn, as many as the scar has.
        sorensen_at_area: 2 |A and S| / (|A| + |S|) of the same sets.
        jaccard: Jaccard index of the cells with a burn probability of ``BURNS`` or more by the known hour.
        sorensen: Sorensen index of the same sets.
        area_error: |A| / |S| - 1 of the same sets.
        arrival_bias: Mean of predicted minus observed times of arrival, over cells that burned in both [minutes].
        arrival_error: Root mean square of the same difference [minutes].
    """

    jaccard_at_area: float
    sorensen_at_area: float
    jaccard: float | None = None
    sorensen: float | None = None
    area_error: float | None = None
    arrival_bias: float | None = None
    arrival_error: float | None = None


def jaccard(burned: Tensor, scar: Tensor) -> Tensor:
    """Return |A and S| / |A or S| (Jaccard 1901), float32 [...]; 1 where both are empty.

    Args:
        burned: A, bool [..., H, W].
        scar: S, bool [..., H, W].
    """
    both, either = _count(burned & scar), _count(burned | scar)
    return torch.where(either > 0.0, both / either.clamp(min=1.0), 1.0)


def sorensen(burned: Tensor, scar: Tensor) -> Tensor:
    """Return 2 |A and S| / (|A| + |S|) (Sorensen 1948; Dice 1945), float32 [...]; 1 where both are empty."""
    both, total = _count(burned & scar), _count(burned) + _count(scar)
    return torch.where(total > 0.0, 2.0 * both / total.clamp(min=1.0), 1.0)


def area_error(burned: Tensor, scar: Tensor) -> Tensor:
    """Return |A| / |S| - 1, float32 [...]."""
    return _count(burned) / _count(scar).clamp(min=1.0) - 1.0


def burn_probability(arrival: Tensor, minutes: float) -> Tensor:
    """Return the share of fires that reach each cell by a time, float32 [..., H, W].

    Args:
        arrival: Minutes, float32 [..., F, H, W], ``travel.NEVER`` where a fire does not come.
        minutes: The time.
    """
    return (arrival <= minutes).to(torch.float32).mean(-3)


def order_of_burning(arrival: Tensor, minutes: float) -> Tensor:
    """Return by what cells are ranked, the first to burn having the least, float32 [..., H, W].

    The median time where half of the fires come by the known hour; then cells by how few fires come; ``NEVER`` where
    none does.
    """
    probability = burn_probability(arrival, minutes)
    median = arrival.median(-3).values  # the lower one of an even number: not past the hour where half come
    later = torch.where(probability > 0.0, minutes * (2.0 - probability), NEVER)
    return torch.where(probability >= BURNS, median, later)


def first_cells(order: Tensor, count: int) -> Tensor:
    """Return the ``count`` cells of least order, fewer where fewer burn, bool [H, W]."""
    ranked = order.flatten().argsort(stable=True)[:count]
    chosen = torch.zeros(order.numel(), dtype=torch.bool, device=order.device)
    chosen[ranked] = True
    return chosen.view(order.shape) & (order < NEVER / 2)


def arrival_difference(arrival: Tensor, observed: Tensor, minutes: float) -> tuple[float, float] | None:
    """Return the bias and the root mean square error of times of arrival [minutes]; None where no cell burned in both.

    Args:
        arrival: Of some fires, float32 [F, H, W] [minutes]; their median is compared.
        observed: float32 [H, W] [minutes], NaN where not known.
        minutes: The known hour, by which at least half of the fires must come.
    """
    median = arrival.median(-3).values
    both = (median <= minutes) & ~observed.isnan()
    if not both.any():
        return None
    off = (median - observed)[both]
    return float(off.mean()), float(off.square().mean().sqrt())


def scores_of(arrival: Tensor, scar: Tensor, minutes: float, observed: Tensor | None = None) -> Scores:
    """Return the scores of some fires on one map.

    Args:
        arrival: When each fire reaches each cell, float32 [F, H, W] [minutes].
        scar: What burned by the known hour, bool [H, W].
        minutes: The known hour.
        observed: When each cell burned, float32 [H, W] [minutes], NaN where not known; None where nowhere.
    """
    burned = burn_probability(arrival, minutes) >= BURNS
    alike = first_cells(order_of_burning(arrival, minutes), int(scar.sum()))
    times = None if observed is None else arrival_difference(arrival, observed, minutes)
    bias, error = (None, None) if times is None else times
    return Scores(
        jaccard_at_area=float(jaccard(alike, scar)),
        sorensen_at_area=float(sorensen(alike, scar)),
        jaccard=float(jaccard(burned, scar)),
        sorensen=float(sorensen(burned, scar)),
        area_error=float(area_error(burned, scar)),
        arrival_bias=bias,
        arrival_error=error,
    )


def scores_at_area(burned: Tensor, scar: Tensor) -> Scores:
    """Return the scores of cells that have no hour, bool [H, W], as those of the null models."""
    return Scores(
        jaccard_at_area=float(jaccard(burned, scar)),
        sorensen_at_area=float(sorensen(burned, scar)),
    )


def _count(cells: Tensor) -> Tensor:
    return cells.sum((-2, -1)).to(torch.float32)
