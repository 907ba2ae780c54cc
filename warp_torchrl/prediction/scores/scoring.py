"""Scores of a predicted fire at each observation, beside persistence and null models."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.prediction.scores.arrivals import ArrivalError, arrival_error, burn_probability
from warp_torchrl.prediction.scores.cells import jaccard, kappa, sorensen
from warp_torchrl.prediction.scores.growth import STEPS, ForecastScores, forecast_scores, time_between
from warp_torchrl.prediction.scores.null_models import circle_cells, ellipse_cells, walking_ellipse_cells
from warp_torchrl.prediction.scores.predicted import Predicted
from warp_torchrl.prediction.scores.probabilities import Reliability, brier, crps, interval, reliability
from warp_torchrl.prediction.scores.scar import Scores, scores_at_area, scores_of
from warp_torchrl.prediction.scores.seen import Seen
from warp_torchrl.world.fires.sightings import Front

_NO_GROWTH: dict[str, Any] = dict.fromkeys(("growth_jaccard", "growth_sorensen", "brier", "crps"), math.nan)
"""Scores that have no meaning where nothing burned since the observation before."""


@dataclass(frozen=True, kw_only=True)
class Areas:
    """The areas of an ensemble's fires beside the observed one [ha]."""

    seen: float
    median: float
    low: float  # 5 %
    high: float  # 95 %
    crps: float

    @property
    def holds(self) -> bool:
        """Return whether the observed area lies in the interval."""
        return self.low <= self.seen <= self.high


@dataclass(frozen=True, kw_only=True)
class ObservationScores:
    """Scores of a predicted fire at one observation."""

    minutes: float
    kind: str
    seen_ha: float
    predicted_ha: float  # of the cells that at least half of the fires reach
    forecast: ForecastScores
    persistence: Mapping[str, float]  # Jaccard, Sorensen and kappa of the observation before
    areas: Areas | None  # of an ensemble


@dataclass(frozen=True, kw_only=True)
class FireScores:
    """Scores of one predicted fire.

    Attributes:
        observations: In the order of time.
        at_area: Of the last observation: the prediction, ``predicted``, and null models by their names.
        arrival: Errors of times of arrival; None where nowhere are times known.
        brier: Brier score of the burn probability at the last observation, over the whole fire.
        reliability: Of the same probability.
    """

    observations: Sequence[ObservationScores]
    at_area: Mapping[str, Scores]
    arrival: ArrivalError | None
    brier: float
    reliability: Reliability


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """Where a fire started, for the null models.

    Attributes:
        lit: bool [H, W].
        fuel: Cells that can burn, bool [H, W]; None where not known: no null model then.
        wind: Mean wind, float32 [2] [m/s]; None where not known: no ellipse then.
    """

    lit: Tensor
    fuel: Tensor | None = None
    wind: Tensor | None = None


def fire_scores(
    predicted: Predicted, seen: Sequence[Seen], observed: Tensor | None = None, place: Place | None = None
) -> FireScores:
    """Return the scores of a predicted fire.

    Args:
        predicted: The fire.
        seen: What had burned, in the order of time.
        observed: When each cell burned, float32 [H, W] [minutes], NaN where not known; None: between two perimeters
            or passes of a satellite by a cell's way from the first to the second.
        place: Where it started; None where not known.
    """
    begun = torch.zeros(predicted.grid.shape, dtype=torch.bool) if place is None else place.lit
    before = Seen(minutes=0.0, kind="start", burned=begun)
    rows = []
    for each in seen:
        rows.append(_at(predicted, before, each, is_last=each is seen[-1]))
        before = each
    times = times_seen(seen) if observed is None else observed
    last = seen[-1]
    error = None
    if predicted.arrival is not None and times is not None:
        error = arrival_error(predicted.arrival, times, last.minutes)
    chance = predicted.chance(last.minutes, is_last=True)
    return FireScores(
        observations=rows,
        at_area=_at_area(predicted, last, place),
        arrival=error,
        brier=float(brier(chance, last.burned)),
        reliability=reliability(chance.flatten(), last.burned.flatten()),
    )


def times_seen(seen: Sequence[Seen]) -> Tensor | None:
    """Return when cells burned between two perimeters or passes, float32 [H, W] [minutes]; NaN elsewhere.

    None where fewer than two were seen.
    """
    moving = [each for each in seen if each.kind in ("perimeter", "hot spots")]
    if len(moving) < 2:
        return None
    found = torch.full(seen[0].burned.shape, torch.nan)
    for before, after in pairwise(moving):
        front = _front(before, after)
        found = torch.where(front.growth, before.minutes + time_between(front), found)
    return found


def _at(predicted: Predicted, before: Seen, each: Seen, is_last: bool) -> ObservationScores:
    front, hectare = _front(before, each), predicted.grid.cell_size**2 / 10_000.0
    chance = predicted.chance(each.minutes, is_last)
    reached = chance[None]
    if predicted.arrival is not None:
        shares = torch.arange(1, STEPS) / STEPS
        times = before.minutes + front.minutes * shares
        reached = torch.stack([*(burn_probability(predicted.arrival, float(time)) for time in times), chance])
    forecast = forecast_scores(reached, time_between(front), front)
    if predicted.arrival is None or each.kind == "scar":
        forecast = replace(forecast, crps=torch.nan)  # when cells burned, or would, is not known
    if not bool(front.growth.any()):
        forecast = replace(forecast, **_NO_GROWTH)
    areas, seen_ha = predicted.areas(each.minutes), float(each.burned.sum()) * hectare
    return ObservationScores(
        minutes=each.minutes,
        kind=each.kind,
        seen_ha=seen_ha,
        predicted_ha=forecast.area * seen_ha,
        forecast=forecast,
        persistence={
            "jaccard": float(jaccard(before.burned, each.burned)),
            "sorensen": float(sorensen(before.burned, each.burned)),
            "kappa": kappa(before.burned, each.burned),
        },
        areas=None if areas is None or len(areas) < 2 else _areas(areas, seen_ha),
    )


def _front(before: Seen, after: Seen) -> Front:
    anywhere = torch.ones_like(after.burned)
    return Front(before.burned, after.burned, anywhere, max(after.minutes - before.minutes, 1e-3))


def _areas(areas: Tensor, seen: float) -> Areas:
    low, high = interval(areas)
    return Areas(seen=seen, median=float(areas.median()), low=low, high=high, crps=crps(areas, seen))


def _at_area(predicted: Predicted, last: Seen, place: Place | None) -> dict[str, Scores]:
    """Return scores at the area that was seen, of the prediction and of null models."""
    found = {}
    if predicted.arrival is not None:
        found["predicted"] = scores_of(predicted.arrival, last.burned, last.minutes)
    if place is None or place.fuel is None:
        return found
    cells, start = int(last.burned.sum()), place.lit
    grown = {"circle": circle_cells(start, place.fuel, cells)}
    if place.wind is not None:
        grown["ellipse"] = ellipse_cells(start, place.fuel, cells, place.wind)
        grown["walking ellipse"] = walking_ellipse_cells(start, place.fuel, cells, place.wind)
    return found | {name: scores_at_area(burned, last.burned) for name, burned in grown.items()}
