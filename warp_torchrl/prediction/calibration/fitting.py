"""Scores of laws on fires, fits to all fires, and leave-one-out cross-validation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, stdev
from typing import Protocol, cast

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.candidates import burnable
from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.prediction.calibration.parameters import Parameter
from warp_torchrl.prediction.scores.null_models import circle_cells, ellipse_cells, walking_ellipse_cells
from warp_torchrl.prediction.scores.scar import Scores, scores_at_area, scores_of
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.fires.arrival_minutes import arrival_minutes
from warp_torchrl.world.law.rate import RateFire

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of a fit that are tried on fires left out: 0 is the law without a fit."""


class FittingMethod(Protocol):
    """A fitting method: ``Gradients`` or ``Evolution``."""

    def __call__(
        self,
        fire: RateFire,
        parameters: Sequence[Parameter],
        cases: Sequence[FireCase],
        progress: Callable[[int, float], None] = ...,
    ) -> Tensor:
        """Return z, float32 [P]."""
        ...


def score(fire: RateFire, case: FireCase, draws: int = 64, seed: int = 1) -> Scores:
    """Return the scores of a law on one real fire, from ``draws`` simulated fires with drawn rates."""
    key = world_key(torch.arange(draws) + seed)
    parts = arrival_minutes(fire, case.landscape, case.lit, key, case.spells, case.cell_size)
    return scores_of(torch.cat(list(parts)), case.scar, case.last, case.arrival)


def null_scores(fire: RateFire, case: FireCase) -> dict[str, Scores]:
    """Return the scores of the circle and of both ellipses over the cells that can burn under a law."""
    fuel, cells = burnable(fire, case), int(case.scar.sum())
    grown = {
        "circle": circle_cells(case.lit, fuel, cells),
        "ellipse": ellipse_cells(case.lit, fuel, cells, case.wind),
        "walking ellipse": walking_ellipse_cells(case.lit, fuel, cells, case.wind),
    }
    return {name: scores_at_area(burned, case.scar) for name, burned in grown.items()}


def check_not_in_weather(parameters: Sequence[Parameter], cases: Sequence[FireCase]) -> None:
    """Refuse to fit a moisture that a fire's weather file states: the law's value is not used there.

    Raises:
        ValueError: With the parameter and the fire.
    """
    names = [f"moisture.{name}" for name in MOISTURES]
    for each in parameters:
        for case in cases:
            told = [spell.moisture for spell in case.spells if spell.moisture is not None]
            if each.name in names and any(not bool(row[names.index(each.name)].isnan()) for row in told):
                raise ValueError(f"parameters must not be told by the weather, {each.name} is by that of {case.name}")


def check_fuel_codes(case: FireCase, fire: RateFire) -> None:
    """Refuse a fire whose map has fuel codes that the law lacks.

    Raises:
        ValueError: With the fire, the codes and their cells.
    """
    try:
        fire.check_fuel(case.landscape)
    except ValueError as error:
        raise ValueError(f"{case.name}: {error}") from None


def folds(cases: Sequence[FireCase]) -> Iterator[tuple[FireCase, list[FireCase]]]:
    """Yield each fire with all the others."""
    for index, left_out in enumerate(cases):
        yield left_out, [case for place, case in enumerate(cases) if place != index]


def agreement(scores: Scores) -> float:
    """Return the mean of the Jaccard indices at the area and at the known hour."""
    return (scores.jaccard_at_area + cast("float", scores.jaccard)) / 2.0  # of a law, which has both


@dataclass(frozen=True)
class Shrinkage:
    """Share of a fit that a law keeps, and what that share gains on fires left out."""

    share: float
    gain: float = 0.0  # mean of ``agreement`` over that without a fit
    error: float = 0.0  # standard error of that mean; 0 of one fire
    fires: int = 0  # left out; 0: the share was not tried on any

    def __str__(self) -> str:
        """Return it in one line."""
        line = f"share of the fit that the law has: {self.share:g}"
        if not self.fires:
            return f"{line}; not tried on fires left out"
        if self.share == 0.0:
            return f"{line}; on {self.fires} fires left out none is better than no fit by its standard error"
        return (
            f"{line}; on {self.fires} fires left out its Jaccard index is higher by {self.gain:.3f} +- {self.error:.3f}"
        )


def shrinkage(found: Sequence[Mapping[float, Scores]]) -> Shrinkage:
    """Return the share of a fit with the best mean agreement on fires left out; of equal ones the least.

    Gains and deviations move by their logarithm, so that a share shrinks that towards the law without a fit. Where the
    best share does not gain more than the standard error of its gain (Breiman et al. 1984, section 3.4.3), it is 0.

    Args:
        found: Of each fire the scores under each share of ``SHARES`` of the fit to the others.
    """
    gains = {share: [agreement(each[share]) - agreement(each[0.0]) for each in found] for share in SHARES}
    best = max(SHARES, key=lambda share: (mean(gains[share]), -share))
    error = stdev(gains[best]) / len(found) ** 0.5 if len(found) > 1 else 0.0
    if mean(gains[best]) <= error:
        return Shrinkage(0.0, fires=len(found))
    return Shrinkage(best, mean(gains[best]), error, len(found))
