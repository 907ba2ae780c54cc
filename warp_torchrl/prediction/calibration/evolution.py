"""Fits by evolution: covariance matrix adaptation (Hansen 2016, arXiv:1604.00772), from the package ``cma``.

The paper that this project builds on fits Rothermel's model by genetic algorithms, the ancestors of this method. It
needs scores only, so it can fit any parameter, deviations of rates included.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.candidates import arrivals, burnable, median_arrivals
from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.prediction.calibration.losses import Loss, jaccard_loss, probability_loss
from warp_torchrl.prediction.calibration.parameters import DEVIATIONS, Parameter, fire_at
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.law.rate import RateFire

_FIRST_STEP = 0.7  # deviation of the first generation: z's priors have 1
_DRAWS = 16  # fires of a candidate, where deviations are fitted


@dataclass(frozen=True, kw_only=True)
class Evolution:
    """Evolution of candidates; all candidates of a generation burn each fire in one batch.

    Attributes:
        generations: How many.
        population: Candidates of each.
        loss: What is made small. Without deviations it is that of the fire of median rates.
        prior_weight: Weight of z^2 / 2 against the mean loss of the fires.
        seed: Of the candidates' draws, and of the fires'.

    Raises:
        ValueError: If a value is out of its range.
    """

    generations: int = 15
    population: int = 8
    loss: Loss = "jaccard"
    prior_weight: float = 0.1
    seed: int = 1

    def __post_init__(self) -> None:
        check_fields(
            self, generations=(1, 10_000), population=(4, 1000), prior_weight=(0.0, 100.0), seed=(1, 2**31 - 1)
        )

    def __call__(
        self,
        fire: RateFire,
        parameters: Sequence[Parameter],
        cases: Sequence[FireCase],
        progress: Callable[[int, float], None] = lambda step, loss: None,
    ) -> Tensor:
        """Return the best z, float32 [P].

        Args:
            fire: The law at z = 0.
            parameters: Parameters to fit.
            cases: The fires.
            progress: Called with the number and the least loss of each generation.

        Raises:
            ValueError: If the package cma is not installed, or the loss does not depend on a parameter.
        """
        self._check(parameters)
        strategy = self._strategy(fire, parameters)
        best, least = torch.zeros(len(parameters)), float("inf")
        for generation in range(self.generations):
            asked = strategy.ask()
            candidates = torch.tensor(np.stack(asked), dtype=torch.float32)[:, : len(parameters)]
            losses = self.losses(fire, parameters, candidates, cases)
            strategy.tell(asked, losses.tolist())
            if float(losses.min()) < least:
                best, least = candidates[losses.argmin()], float(losses.min())
            progress(generation + 1, least)
        return best

    def losses(
        self, fire: RateFire, parameters: Sequence[Parameter], candidates: Tensor, cases: Sequence[FireCase]
    ) -> Tensor:
        """Return the loss of each candidate, float32 [G]; candidates are z, float32 [G, P]."""
        laws = [fire_at(fire, parameters, z) for z in candidates]
        drawn = any(each.name in DEVIATIONS for each in parameters)
        total = torch.stack([self._of_case(laws, case, drawn) for case in cases]).mean(0)
        return total + self.prior_weight * 0.5 * candidates.square().sum(1)

    def _of_case(self, laws: Sequence[RateFire], case: FireCase, drawn: bool) -> Tensor:
        key = world_key(torch.arange(_DRAWS) + self.seed)
        times = arrivals(laws, case, key) if drawn else median_arrivals(laws, case)
        if self.loss == "jaccard":
            return torch.tensor([jaccard_loss(each, case.minutes, case.burned) for each in times])
        probability = (times[:, None] <= case.minutes[:, None, None, None]).to(torch.float32).mean(2)
        fuel = burnable(laws[0], case)
        return torch.stack([probability_loss(each, case.burned, fuel, self.loss) for each in probability])

    def _check(self, parameters: Sequence[Parameter]) -> None:
        for each in parameters:
            if each.name in DEVIATIONS and self.loss == "jaccard":
                raise ValueError(f"loss must be brier or cross_entropy where {each.name} is fitted, got jaccard")

    def _strategy(self, fire: RateFire, parameters: Sequence[Parameter]) -> Any:
        try:
            import cma
        except ImportError:
            raise ValueError('evolution needs cma, which is missing: pip install "warp_torchrl[calibration]"') from None
        low, high = zip(*(each.limits(each.usual(fire)) for each in parameters), strict=True)
        pad = [1.0] * (len(parameters) == 1)  # cma wants two dimensions at least
        options = {
            "bounds": [[*low, *(-each for each in pad)], [*high, *pad]],
            "popsize": self.population,
            "seed": self.seed,
            "verbose": -9,
        }
        return cma.CMAEvolutionStrategy([0.0] * (len(parameters) + len(pad)), _FIRST_STEP, options)
