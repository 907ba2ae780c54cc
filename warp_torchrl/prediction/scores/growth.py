"""Scores of a fire's growth between two observations, as forecasters give them.

Sums are over cells that had not burned by the observation before, so the Brier score of a forecast without growth
(persistence) is 1.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from warp_torchrl.prediction.scores.cells import BURNS, area_error, jaccard, kappa, sorensen
from warp_torchrl.prediction.scores.probabilities import Reliability, arrival_crps, brier, reliability
from warp_torchrl.world.fires.sightings import Front

STEPS = 12
"""Times at which a forecast of arrival is compared between two observations."""


@dataclass(frozen=True, kw_only=True)
class GrowthScores:
    """Agreement of a forecast with an observation over the growth between them."""

    growth_jaccard: float
    growth_sorensen: float  # the score F1 of the day's growth (Bennett et al. 2026)
    brier: float


@dataclass(frozen=True, kw_only=True)
class ForecastScores(GrowthScores):
    """Agreement of one forecast with one observation."""

    jaccard: float  # of burned cells: those that at least half of the members reach
    sorensen: float  # of the same cells
    kappa: float  # of the same cells over the whole map
    area: float  # of cells predicted to burn over that of cells that burned
    crps: float  # of arrival [minutes]
    reliability: Reliability


def growth_scores(chance: Tensor, front: Front) -> GrowthScores:
    """Return the scores of F, float32 [H, W]."""
    return GrowthScores(**_of_growth(chance, front))


def forecast_scores(reached: Tensor, arrival: Tensor, front: Front) -> ForecastScores:
    """Return the scores of a forecast.

    Args:
        reached: F at the ends of S equal steps between two observations, float32 [S, H, W].
        arrival: When each cell burned since the observation before, float32 [H, W] [minutes]; over ``front.minutes``
            where it has not, see ``time_between``.
        front: The two observations.
    """
    chance, outside = reached[-1], ~front.known
    burns = chance >= BURNS
    return ForecastScores(
        **_of_growth(chance, front),
        jaccard=float(jaccard(burns, front.burned)),
        sorensen=float(sorensen(burns, front.burned)),
        kappa=kappa(burns, front.burned),
        area=1.0 + float(area_error(burns, front.burned)),
        crps=arrival_crps(reached, arrival, front.minutes, outside),
        reliability=reliability(chance[outside], front.burned[outside]),
    )


def time_between(front: Front) -> Tensor:
    """Return when cells burned between two perimeters, float32 [H, W] [minutes since the first].

    A cell d_0 cells from the first and d_1 from the outside of the second burned at the share
    (d_0 - 1/2) / (d_0 + d_1 - 1) of the time, for the edges lie between cells; 0 inside the first, and twice the time
    where nothing burned.
    """
    growth = front.growth
    after, before = _steps(front.known, growth), _steps(~front.burned, growth)
    share = (after - 0.5) / (after + before - 1.0)
    return torch.where(growth, share * front.minutes, torch.where(front.known, 0.0, 2.0 * front.minutes))


def _of_growth(chance: Tensor, front: Front) -> dict[str, float]:
    outside = ~front.known
    burns = (chance >= BURNS) & outside
    return {
        "growth_jaccard": float(jaccard(burns, front.growth)),
        "growth_sorensen": float(sorensen(burns, front.growth)),
        "brier": float(brier(chance, front.growth, outside)),
    }


def _steps(cells: Tensor, within: Tensor) -> Tensor:
    """Return the moves of a king from some cells to each of others, float32 [H, W]; 1 where there is no way."""
    found, reached = torch.ones(cells.shape), cells.clone()
    near, step = cells, 0
    while bool(near.any()):
        found[near] = float(max(1, step))
        step += 1
        near = (max_pool2d(reached[None, None].float(), 3, 1, 1)[0, 0] > 0.0) & within & ~reached
        reached |= near
    return found
