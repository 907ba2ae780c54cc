"""Agreement of some fires with one scar, at its area and at its hour."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl.prediction.scores.arrivals import arrival_error, burn_probability, first_cells, order_of_burning
from warp_torchrl.prediction.scores.cells import BURNS, area_error, jaccard, kappa, sorensen
from warp_torchrl.prediction.scores.probabilities import brier


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Agreement of one map of fires with one scar; None where no comparison is possible.

    Attributes:
        jaccard_at_area: |A and S| / |A or S|, where A holds the first cells to burn, as many as the scar has.
        sorensen_at_area: 2 |A and S| / (|A| + |S|) of the same sets.
        jaccard: Jaccard index of the cells with a burn probability of ``BURNS`` or more by the known hour.
        sorensen: Sorensen index of the same sets.
        kappa: Cohen's kappa of the same sets over the whole map.
        area_error: |A| / |S| - 1 of the same sets.
        brier: Brier score of the burn probability, divided by the number of cells that burned.
        arrival_bias: Mean of predicted minus observed times of arrival, over cells that burned in both [minutes].
        arrival_mae: Mean of the absolute difference [minutes].
        arrival_error: Root mean square of the same difference [minutes].
    """

    jaccard_at_area: float
    sorensen_at_area: float
    jaccard: float | None = None
    sorensen: float | None = None
    kappa: float | None = None
    area_error: float | None = None
    brier: float | None = None
    arrival_bias: float | None = None
    arrival_mae: float | None = None
    arrival_error: float | None = None


def scores_of(arrival: Tensor, scar: Tensor, minutes: float, observed: Tensor | None = None) -> Scores:
    """Return the scores of some fires on one map.

    Args:
        arrival: When each fire reaches each cell, float32 [F, H, W] [minutes].
        scar: What burned by the known hour, bool [H, W].
        minutes: The known hour.
        observed: When each cell burned, float32 [H, W] [minutes], NaN where not known; None where nowhere.
    """
    chance = burn_probability(arrival, minutes)
    burned = chance >= BURNS
    alike = first_cells(order_of_burning(arrival, minutes), int(scar.sum()))
    times = None if observed is None else arrival_error(arrival, observed, minutes)
    return Scores(
        jaccard_at_area=float(jaccard(alike, scar)),
        sorensen_at_area=float(sorensen(alike, scar)),
        jaccard=float(jaccard(burned, scar)),
        sorensen=float(sorensen(burned, scar)),
        kappa=kappa(burned, scar),
        area_error=float(area_error(burned, scar)),
        brier=float(brier(chance, scar)),
        arrival_bias=None if times is None else times.bias,
        arrival_mae=None if times is None else times.mean_absolute,
        arrival_error=None if times is None else times.root_mean_square,
    )


def scores_at_area(burned: Tensor, scar: Tensor) -> Scores:
    """Return the scores of cells that have no hour, bool [H, W], as those of the null models."""
    return Scores(
        jaccard_at_area=float(jaccard(burned, scar)),
        sorensen_at_area=float(sorensen(burned, scar)),
    )
