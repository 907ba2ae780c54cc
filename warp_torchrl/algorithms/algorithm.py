"""Base of all algorithms: ranges of their numbers, the decentralised actor, and the falling learning rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torchrl.modules import MaskedCategorical, ProbabilisticActor

from warp_torchrl.models import ACTION, ACTION_MASK, LOG_PROB, LOGITS, Mlp, Signature
from warp_torchrl.validation import check_fields

_RANGES = {
    "gamma": (0.0, 1.0),
    "learning_rate": (0.0, 1.0),
    "learning_rate_end": (0.0, 1.0),
    "max_grad_norm": (1e-6, 1e6),
}


@dataclass(frozen=True, kw_only=True)
class Algorithm:
    """Base class of on-policy and off-policy algorithms.

    Attributes:
        gamma: Discount.
        learning_rate: Of Adam at the start.
        learning_rate_end: At the end, as a share of the start; it falls linearly.
        max_grad_norm: Gradient clipping.

    Raises:
        ValueError: If a value is out of its range.
    """

    gamma: float = 0.99
    learning_rate: float = 1e-3
    learning_rate_end: float = 0.05
    max_grad_norm: float = 0.5

    def __post_init__(self) -> None:
        self.check()

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the fields' choices and kinds, their ranges, and those of further fields in ``ranges``."""
        check_fields(self, **_RANGES, **ranges)

    def check_batch(self, frames_per_batch: int) -> None:
        """Check that the algorithm can learn from batches of this many world steps.

        Raises:
            ValueError: If it cannot.
        """

    def check_model(self, model: Mlp) -> None:
        """Check that the algorithm can train the networks of a model.

        Raises:
            ValueError: If it cannot.
        """

    def rate_at(self, progress: float, optimizer: torch.optim.Optimizer) -> float:
        """Set the optimiser's learning rate to that of progress in 0..1, and return it."""
        rate = self.learning_rate * falling(1.0, self.learning_rate_end, progress)
        for group in optimizer.param_groups:
            if isinstance(group["lr"], Tensor):  # that of a step which a GPU has recorded
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate
        return rate


def falling(start: float, end: float, progress: float) -> float:
    """Return the value between a start and an end at progress in 0..1, after which it stays."""
    return start + (end - start) * min(progress, 1.0)


class MaskedChoice(MaskedCategorical):
    """TorchRL's distribution of masked actions, which also samples where probabilities are NaN.

    On a GPU such a sample would abort the program. Here an arbitrary action is drawn, and the logits keep their NaN:
    training and evaluation check that logits are finite.
    """

    def sample(self, sample_shape: torch.Size | Sequence[int] | None = None) -> Tensor:
        """Return actions, int64 [...]."""
        chances: Tensor = self.probs  # type: ignore[has-type]
        self.probs = chances.nan_to_num(nan=1.0)
        try:
            return super().sample(sample_shape)
        finally:
            self.probs = chances


def masked_actor(shape: Signature, model: Mlp, **distribution: float | bool) -> ProbabilisticActor:
    """Return a team's decentralised policy: each agent's action is drawn from its observation and mask.

    Args:
        shape: Signature of the team.
        model: Makes the network.
        distribution: Options of TorchRL's ``MaskedCategorical``.
    """
    return ProbabilisticActor(
        model.actor(shape),
        in_keys={"logits": LOGITS, "mask": ACTION_MASK},
        out_keys=[ACTION],
        distribution_class=MaskedChoice,
        distribution_kwargs={"use_cross_entropy": False, **distribution},
        return_log_prob=True,
        log_prob_key=LOG_PROB,
    )
