"""Optimiser steps with finite losses and gradients only, and sums over a batch's steps."""

from collections.abc import Mapping

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.system.finite import NumericalFailure

__all__ = ["FiniteSteps", "NumericalFailure"]


class FiniteSteps:
    """Takes optimiser steps until the first loss or gradient that is not finite.

    On a CPU every step is checked. On a GPU each check would be a synchronisation: there a flag stays on the device,
    with which a fused optimiser leaves the weights unchanged, and it is read once per batch.

    Args:
        optimizer: A fused one: it reads ``found_inf``, as torch's ``GradScaler`` has it.
    """

    def __init__(self, optimizer: torch.optim.Optimizer) -> None:
        self._optimizer = optimizer
        self._first: Tensor | None = None  # [refused, loss, norm] of the first step that was refused, else the last

    def take(self, loss: Tensor, norm: Tensor, frames: int) -> None:
        """Take a step.

        Args:
            loss: The loss that the gradients are of, [].
            norm: Their norm, [].
            frames: World steps so far, for the message.

        Raises:
            NumericalFailure: If the loss or the norm is not finite, and reading them needs no synchronisation.
        """
        if needs_no_sync(loss.device):
            if not torch.isfinite(norm + loss):
                raise _failure(frames, float(loss), float(norm))
        else:
            self._refuse_unless_finite(loss, norm)
        self._optimizer.step()

    def _refuse_unless_finite(self, loss: Tensor, norm: Tensor) -> None:
        if self._first is None:
            self._first = torch.zeros(3, device=loss.device)
            self._optimizer.found_inf = self._first[0]  # type: ignore[attr-defined]
        now = torch.stack(((~torch.isfinite(norm + loss)).to(norm.dtype), loss, norm))
        self._first.copy_(torch.where(self._first[0] > 0.0, self._first, now))  # in its place: it may be recorded

    def read(self, sums: Mapping[str, Tensor], frames: int) -> dict[str, float]:
        """Return the sums of a batch's steps, read from the device at once.

        Args:
            sums: Numbers by name, [] each.
            frames: World steps so far, for the message.

        Raises:
            NumericalFailure: If a step was refused.
        """
        first = [] if self._first is None else list(self._first.double())
        parts = [each.double() for each in sums.values()] + first
        told = torch.stack(parts).tolist() if parts else []
        if self._first is not None:
            self._first.zero_()
        if first and told[-3]:
            raise _failure(frames, *told[-2:])
        return dict(zip(sums, told))


def _failure(frames: int, loss: float, norm: float) -> NumericalFailure:
    return NumericalFailure(
        f"after {frames} frames the loss, {loss:g}, or its gradient, of norm {norm:g}, is not finite; the weights were "
        "left as they were, and the last checkpoint stands"
    )
