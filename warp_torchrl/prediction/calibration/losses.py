"""Losses of a fit: the difference of expected burning, or of the fire of median rates, from the observed scar."""

from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.prediction.scores.arrivals import first_cells, order_of_burning
from warp_torchrl.prediction.scores.cells import BURNS, jaccard

Loss = Literal["jaccard", "cross_entropy", "brier"]
"""``jaccard`` is the mean of 1 - J at the known hours and at the scar's area; the others compare probabilities."""
FLOOR = 1e-2
"""Least probability of what happened: no cell costs more than -ln of it."""


def jaccard_loss(arrival: Tensor, minutes: Tensor, burned: Tensor) -> float:
    """Return half of 1 - J at the known hours, their mean, and half of 1 - J at the scar's area.

    Args:
        arrival: float32 [F, H, W] [minutes].
        minutes: The known hours, float32 [K] [minutes].
        burned: What had burned by then, bool [K, H, W].
    """
    told = (arrival[None] <= minutes[:, None, None, None]).to(torch.float32).mean(1) >= BURNS
    alike = first_cells(order_of_burning(arrival, float(minutes[-1])), int(burned[-1].sum()))
    return float(1.0 - 0.5 * jaccard(told, burned).mean() - 0.5 * jaccard(alike, burned[-1]))


def probability_loss(probability: Tensor, burned: Tensor, fuel: Tensor, loss: Loss) -> Tensor:
    """Return the cross-entropy or the Brier score over cells of fuel, for each burned cell, mean over the hours.

    Args:
        probability: Of burning by each hour, float32 [K, H, W].
        burned: What burned by then, bool [K, H, W].
        fuel: Cells that can burn, bool [H, W].
        loss: ``cross_entropy`` or ``brier`` (Brier 1950).
    """
    happened = torch.where(burned, probability, 1.0 - probability)
    cost = -happened.clamp(min=FLOOR).log() if loss == "cross_entropy" else (1.0 - happened).square()
    return ((cost * fuel).sum((1, 2)) / burned.sum((1, 2)).clamp(min=1)).mean()
