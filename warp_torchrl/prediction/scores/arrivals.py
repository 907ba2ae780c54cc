"""Times of arrival of some fires: probabilities, the order in which cells burn, and errors of times."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.prediction.scores.cells import BURNS
from warp_torchrl.world.law.travel import NEVER


@dataclass(frozen=True)
class ArrivalError:
    """Predicted minus observed times of arrival, over cells that burned in both [minutes]."""

    bias: float  # mean
    mean_absolute: float
    root_mean_square: float


def burn_probability(arrival: Tensor, minutes: float) -> Tensor:
    """Return the share of fires that reach each cell by a time, float32 [..., H, W].

    Args:
        arrival: Minutes, float32 [..., F, H, W], ``travel.NEVER`` where a fire does not come.
        minutes: The time.
    """
    return (arrival <= minutes).to(torch.float32).mean(-3)


def order_of_burning(arrival: Tensor, minutes: float) -> Tensor:
    """Return by what cells are ranked, the first to burn having the least, float32 [..., H, W].

    The median time where half of the fires come by the known hour; then cells by how few fires come; ``NEVER`` where
    none does.
    """
    probability = burn_probability(arrival, minutes)
    median = arrival.median(-3).values  # the lower one of an even number: not past the hour where half come
    later = torch.where(probability > 0.0, minutes * (2.0 - probability), NEVER)
    return torch.where(probability >= BURNS, median, later)


def first_cells(order: Tensor, count: int) -> Tensor:
    """Return the ``count`` cells of least order, fewer where fewer burn, bool [H, W]."""
    ranked = order.flatten().argsort(stable=True)[:count]
    chosen = torch.zeros(order.numel(), dtype=torch.bool, device=order.device)
    chosen[ranked] = True
    return chosen.view(order.shape) & (order < NEVER / 2)


def arrival_error(arrival: Tensor, observed: Tensor, minutes: float) -> ArrivalError | None:
    """Return the errors of times of arrival; None where no cell burned in both.

    Args:
        arrival: Of some fires, float32 [F, H, W] [minutes]; their median is compared.
        observed: float32 [H, W] [minutes], NaN where not known.
        minutes: The known hour, by which at least half of the fires must come.
    """
    median = arrival.median(-3).values
    both = (median <= minutes) & ~observed.isnan()
    if not both.any():
        return None
    off = (median - observed)[both]
    return ArrivalError(float(off.mean()), float(off.abs().mean()), float(off.square().mean().sqrt()))
