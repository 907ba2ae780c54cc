"""Probabilities from strengths, as ``law`` has it, in the memory of what is used up."""

from typing import Protocol

import torch
from torch import Tensor

from warp_torchrl.world.law.law import LARGEST_ALPHA, Clipped, Hazard


class Joining(Protocol):
    """What a backend needs of a law; all tensors are float32, those of one call have one shape."""

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return the ground's part of a strength."""
        ...

    def join(self, total: Tensor, strength: Tensor, spare: Tensor) -> None:
        """Add a direction's strength to the total; the strength and the spare tensor are used up."""
        ...

    def probability_of(self, strength: Tensor) -> Tensor:
        """Return the probability of one strength, in the strength's own memory."""
        ...

    def probability(self, total: Tensor) -> Tensor:
        """Return the probability to ignite of a total over the directions, in the total's own memory."""
        ...


class ClippedInPlace:
    """Law ``paper``. The total stands in its sum once, so that a compiler writes it out eight times, not 2^8."""

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return alpha itself."""
        return alpha

    def join(self, total: Tensor, strength: Tensor, spare: Tensor) -> None:
        """Make p + q (1 - p) of the total q."""
        strength.clamp_(max=1.0)
        torch.sub(strength, total.mul_(torch.sub(strength, 1.0, out=spare)), out=total)

    def probability_of(self, strength: Tensor) -> Tensor:
        """Return clip(f, 0, 1)."""
        return strength.clamp_(max=1.0)

    def probability(self, total: Tensor) -> Tensor:
        """Return the total, which is the probability."""
        return total


class HazardInPlace:
    """Law ``hazard``.

    Args:
        refinement: k, ticks to one of the paper's.
    """

    def __init__(self, refinement: int) -> None:
        self._scale = -1.0 / refinement

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return -ln(1 - min(alpha, 0.95)) / k."""
        return alpha.clamp(max=LARGEST_ALPHA).neg_().log1p_().mul_(self._scale)

    def join(self, total: Tensor, strength: Tensor, spare: Tensor) -> None:
        """Add f."""
        total += strength

    def probability_of(self, strength: Tensor) -> Tensor:
        """Return 1 - exp(-f)."""
        return strength.neg_().expm1_().neg_()

    def probability(self, total: Tensor) -> Tensor:
        """Return 1 - exp(-sum f)."""
        return self.probability_of(total)


def in_place(law: Clipped) -> Joining:
    """Return the joining of one of the two laws."""
    return HazardInPlace(law.refinement) if isinstance(law, Hazard) else ClippedInPlace()
