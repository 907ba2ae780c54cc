"""Fits by gradients through expected burning: Fisher scoring, damped (McCullagh and Nelder 1989, section 2.5)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.prediction.calibration.expected import Margin, burning_probability, margin
from warp_torchrl.prediction.calibration.losses import FLOOR, Loss, probability_loss
from warp_torchrl.prediction.calibration.parameters import DEVIATIONS, Parameter
from warp_torchrl.validation import check_fields
from warp_torchrl.world.law.rate import RateFire

_LONGEST = 1.5  # most that a z moves in a step
_ENOUGH = 0.02  # a step that moves no z by more ends the fit


@dataclass(frozen=True, kw_only=True)
class Gradients:
    """Fisher scoring steps, damped by halving where a step does not reduce the loss.

    Attributes:
        steps: Maximum number of steps.
        loss: ``cross_entropy`` or ``brier``.
        softness: Deviation of the logarithm of a fire's rates, which makes burning uncertain.
        prior_weight: Weight of z^2 / 2 against the mean loss of the fires.

    Raises:
        ValueError: If a value is out of its range.
    """

    steps: int = 8
    loss: Loss = "cross_entropy"
    softness: float = 0.2
    prior_weight: float = 0.1

    def __post_init__(self) -> None:
        check_fields(self, steps=(1, 1000), softness=(0.02, 1.0), prior_weight=(0.0, 100.0))
        if self.loss == "jaccard":
            raise ValueError("loss must be cross_entropy or brier for gradients, got jaccard")

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
            progress: Called with the number and the least loss of each step.

        Raises:
            ValueError: If a deviation is among the parameters: arrival times at median rates do not depend on it.
        """
        for each in parameters:
            if each.name in DEVIATIONS:
                raise ValueError(f"method must be evolution where {each.name} is fitted, got gradients")
        low, high = torch.tensor([each.limits(each.usual(fire)) for each in parameters]).T
        best = torch.zeros(len(parameters))
        least, gradient, curvature = self.slope(fire, parameters, best, cases)
        share = 1.0
        for number in range(self.steps):
            move = -share * torch.linalg.solve(curvature, gradient).clamp(-_LONGEST, _LONGEST)
            z = (best + move).clamp(low, high)
            if float((z - best).abs().max()) < _ENOUGH:
                break
            found = self.slope(fire, parameters, z, cases)
            if found[0] < least:
                best, (least, gradient, curvature), share = z, found, min(1.0, 2.0 * share)
            else:
                share *= 0.4
            progress(number + 1, least)
        return best

    def slope(
        self, fire: RateFire, parameters: Sequence[Parameter], z: Tensor, cases: Sequence[FireCase]
    ) -> tuple[float, Tensor, Tensor]:
        """Return the loss, its gradient [P] and its expected curvature [P, P], with those of the prior."""
        found = [self._of_case(margin(fire, parameters, z, case), case) for case in cases]
        losses, gradients, curvatures = zip(*found, strict=True)
        weight = self.prior_weight
        return (
            float(torch.stack(losses).mean() + weight * 0.5 * z.square().sum()),
            torch.stack(gradients).mean(0) + weight * z,
            torch.stack(curvatures).mean(0) + max(weight, 1e-6) * torch.eye(len(z)),
        )

    def _of_case(self, at: Margin, case: FireCase) -> tuple[Tensor, Tensor, Tensor]:
        factor = at.log_factor.requires_grad_()
        probability = burning_probability(factor, self.softness)
        loss = probability_loss(probability, case.burned, at.fuel, self.loss)
        by_factor = torch.autograd.grad(loss, factor)[0]
        gradient = (by_factor * at.gradient).flatten(1).sum(1)
        weight = self._expected_curvature(factor.detach(), case) * at.fuel
        curvature = torch.einsum("pkhw,khw,qkhw->pq", at.gradient, weight, at.gradient)
        return loss.detach(), gradient, curvature

    def _expected_curvature(self, factor: Tensor, case: FireCase) -> Tensor:
        """Return the expected second derivative of the loss by x* in each cell, float32 [K, H, W]."""
        probability = burning_probability(factor, self.softness)
        density = torch.exp(-0.5 * (factor / self.softness).square()) / (self.softness * (2.0 * torch.pi) ** 0.5)
        spread = (probability * (1.0 - probability)).clamp(min=FLOOR) if self.loss == "cross_entropy" else 0.5
        cells = case.burned.sum((1, 2), keepdim=True).clamp(min=1) * len(case.burned)
        return density.square() / spread / cells
