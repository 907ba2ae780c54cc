"""The two laws: how the strengths with which burning neighbours act on a tree make its chance to ignite.

Each burning neighbour acts with a strength f = susceptibility w_d s_d / distance_d.
"""

from typing import Protocol

import torch
from torch import Tensor

LARGEST_ALPHA = 0.95
"""Flammability from which law ``hazard`` grows no more: at 1 its hazard would have no bound."""


class Law(Protocol):
    """What makes chances of strengths; all tensors are float32, those of one call have one shape."""

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return the ground's part of a strength."""
        ...

    def join(self, total: Tensor, strength: Tensor, spare: Tensor) -> None:
        """Add a direction's strength to the total; the strength and the spare tensor are used up."""
        ...

    def chance_of(self, strength: Tensor) -> Tensor:
        """Return the chance of one strength, in the strength's own memory."""
        ...

    def chance(self, total: Tensor) -> Tensor:
        """Return the chance to ignite of a total over the directions, in the total's own memory."""
        ...


class Clipped:
    """Law ``paper``: p_d = clip(f, 0, 1), and q = 1 - prod (1 - p_d) (WARP-CA, spread).

    q is accumulated as p_d + q (1 - p_d), which keeps 0, 1 and small numbers exact; q stands in it once, so that a
    compiler that writes it out does so eight times, not 2^8.
    """

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return alpha itself."""
        return alpha

    def join(self, total: Tensor, strength: Tensor, spare: Tensor) -> None:
        """Make p + q (1 - p) of the total q."""
        strength.clamp_(max=1.0)
        torch.sub(strength, total.mul_(torch.sub(strength, 1.0, out=spare)), out=total)

    def chance_of(self, strength: Tensor) -> Tensor:
        """Return clip(f, 0, 1)."""
        return strength.clamp_(max=1.0)

    def chance(self, total: Tensor) -> Tensor:
        """Return the total, which is the chance."""
        return total


class Hazard:
    """Law ``hazard``: p_d = 1 - exp(-f), and q = 1 - exp(-sum f).

        f = h_d = -ln(1 - min(alpha, 0.95)) / k w_d s_d / dist_d

    After the k ticks of one of the paper's, and all the F stages, a neighbour has been lit with 1 - (1 - alpha)^F.

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

    def chance_of(self, strength: Tensor) -> Tensor:
        """Return 1 - exp(-f)."""
        return strength.neg_().expm1_().neg_()

    def chance(self, total: Tensor) -> Tensor:
        """Return 1 - exp(-sum f)."""
        return self.chance_of(total)
