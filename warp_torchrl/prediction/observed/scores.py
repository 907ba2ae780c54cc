"""Scores of forecasts of a fire's growth, as forecasters give them.

F(x, t) is the share of the members that reach cell x by time t, o(x, t) is 1 where the fire has. Sums are over cells
that had not burned by the observation before. Divided by the number that then burned, the Brier score is 1 for a
forecast without growth (persistence), whatever the fire's size:

    Brier = sum (F - o)^2 / sum o                        (Brier 1950)
    CRPS  = sum of the integral of (F - o)^2 dt / sum o  (Matheson and Winkler 1976) [minutes]
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from warp_torchrl.prediction.calibration.scores import BURNS, jaccard
from warp_torchrl.world.fires.sightings import Front

BINS = 10
"""Of a reliability table."""


@dataclass(frozen=True, kw_only=True)
class ForecastScores:
    """Agreement of one forecast with one observation."""

    jaccard: float  # of burned cells: those that at least half of the members reach
    kappa: float  # of the same cells over the whole map (Cohen 1960)
    growth_jaccard: float  # of those that burned since the observation before
    brier: float  # over the growth
    crps: float  # of arrival [minutes]
    area: float  # of cells told to burn over that of cells that burned
    reliability: tuple[tuple[float, float, int], ...]  # mean probability, share that burned and cells of each bin


@dataclass(frozen=True, kw_only=True)
class GrowthScores:
    """Agreement of a forecast with an observation over the growth between them."""

    growth_jaccard: float
    brier: float


def growth_scores(chance: Tensor, front: Front) -> GrowthScores:
    """Return the scores of F, float32 [H, W]."""
    outside = ~front.known
    off = ((chance - front.burned.to(torch.float32)).square() * outside).sum()
    return GrowthScores(
        growth_jaccard=float(jaccard((chance >= BURNS) & outside, front.growth)),
        brier=float(off) / max(1, int(front.growth.sum())),
    )


def forecast_scores(reached: Tensor, arrival: Tensor, front: Front) -> ForecastScores:
    """Return the scores of a forecast.

    Args:
        reached: F at the ends of S equal steps between two observations, float32 [S, H, W].
        arrival: When each cell burned since the observation before, float32 [H, W] [minutes]; over ``front.minutes``
            where it has not, see ``time_between``.
        front: The two observations.
    """
    chance, outside = reached[-1], ~front.known
    told = chance >= BURNS
    steps = torch.arange(1, len(reached) + 1) * (front.minutes / len(reached))
    happened = (arrival <= steps[:, None, None]).to(torch.float32)
    off = ((reached - happened).square() * outside).flatten(1).sum(1)
    growth = max(1, int(front.growth.sum()))
    return ForecastScores(
        jaccard=float(jaccard(told, front.burned)),
        kappa=kappa(told, front.burned),
        growth_jaccard=float(jaccard(told & outside, front.growth)),
        brier=float(off[-1]) / growth,
        crps=float(off.mean()) * front.minutes / growth,
        area=float(told.sum()) / max(1, int(front.burned.sum())),
        reliability=reliability(chance[outside], front.burned[outside]),
    )


def kappa(told: Tensor, burned: Tensor) -> float:
    """Return Cohen's kappa of two sets of cells, bool [H, W], (p_o - p_e) / (1 - p_e); 1 where both are all or none."""
    agreed = float((told == burned).double().mean())
    one, other = float(told.double().mean()), float(burned.double().mean())
    by_chance = one * other + (1.0 - one) * (1.0 - other)
    return 1.0 if by_chance == 1.0 else (agreed - by_chance) / (1.0 - by_chance)


def reliability(chance: Tensor, burned: Tensor) -> tuple[tuple[float, float, int], ...]:
    """Return mean probability, share that burned and cells of each bin of probabilities (Murphy and Winkler 1977).

    Cells of probability 0 that did not burn are left out: a larger map would have more of them.

    Args:
        chance: float32 [n].
        burned: bool [n].
    """
    asked = (chance > 0.0) | burned
    chance, burned = chance[asked].double(), burned[asked]
    place = (chance * BINS).long().clamp(max=BINS - 1)
    count = torch.bincount(place, minlength=BINS)
    sums = [torch.bincount(place, each, BINS) / count.clamp(min=1) for each in (chance, burned.double())]
    return tuple(zip(sums[0].tolist(), sums[1].tolist(), count.tolist(), strict=True))


def joined_reliability(tables: Sequence[tuple[tuple[float, float, int], ...]]) -> tuple[tuple[float, float, int], ...]:
    """Return the reliability table of several forecasts together."""
    found = []
    for rows in zip(*tables, strict=True):
        cells = sum(row[2] for row in rows)
        found.append((*(sum(row[at] * row[2] for row in rows) / max(1, cells) for at in (0, 1)), cells))
    return tuple(found)  # type: ignore[arg-type]


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
