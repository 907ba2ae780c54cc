"""Checks for NaN and infinity, and the error that they raise in learning and acting."""

import math
from collections.abc import Iterable

import torch
from torch import Tensor

LARGEST_SCORE = 1.8e19
"""Of a score of an action; the square of more is no float32, and beside it the others are lost."""


class NumericalFailure(Exception):  # noqa: N818
    """An observation, reward, loss or action score that is not finite; no weights were changed."""


def are_unsound(tensors: Iterable[Tensor]) -> Tensor:
    """Return whether any number of some float tensors is NaN or infinite, bool [], without a synchronisation."""
    ends = [each.to(torch.float64) for tensor in tensors if tensor.numel() for each in tensor.detach().aminmax()]
    return ~torch.stack(ends).isfinite().all() if ends else torch.zeros((), dtype=torch.bool)


def not_finite(value: Tensor | float) -> float | None:
    """Return a number of a tensor, or a number itself, that is NaN or infinite; None where all are finite."""
    if not isinstance(value, Tensor):
        return None if math.isfinite(value) else value
    if not value.is_floating_point() or not value.numel():
        return None
    ends = value.detach().aminmax()  # NaN if any number is; unlike a mask it takes no memory
    return next((end for end in map(float, ends) if not math.isfinite(end)), None)


def check_scores(scores: Tensor | None) -> None:
    """Check the logits or values by which actions are chosen; it reads from their device.

    Raises:
        NumericalFailure: If one is not finite, or above ``LARGEST_SCORE``; closed actions may have the lowest float.
    """
    if scores is None or not scores.numel():
        return
    least, most = map(float, scores.detach().aminmax())
    if not (math.isfinite(least) and most <= LARGEST_SCORE):
        unsound = least if math.isfinite(most) and most <= LARGEST_SCORE else most
        raise NumericalFailure(
            f"the policy scores an action {unsound:g}, no number to act by: its weights, or what it is shown, are too "
            "large"
        )
