"""The interface between the training loop and an algorithm."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.objectives import LossModule


class Stateful(Protocol):
    """An object with a state that a checkpoint keeps."""

    def state_dict(self) -> dict[str, Any]:
        """Return tensors and plain values."""
        ...

    def load_state_dict(self, state_dict: dict[str, Any]) -> Any:
        """Restore what ``state_dict`` returned."""
        ...


@dataclass(kw_only=True)
class Learner:
    """An algorithm, ready to learn.

    Attributes:
        policy: Reads observation and mask, writes the action; it is saved and evaluated.
        explore: The policy that the collector runs.
        loss: TorchRL's loss module; it holds every parameter that is trained.
        terms: Called with a sample, returns the terms of the loss and the values to log.
        loss_keys: Entries of the terms that are summed and minimised.
        columns: Names of ``metrics.csv`` by entry of the terms.
        optimizer: Over the loss's parameters.
        max_grad_norm: Gradients are clipped to this norm.
        store: Takes in a collected batch [B, T].
        samples: Returns the minibatches until the next batch; each is one optimiser step.
        after_step: Called with each sample once the optimiser has stepped.
        schedule: Sets the scheduled hyperparameters for progress in 0..1, and returns them as columns.
        keeps: Further objects that an exact resume needs, by name.
        batches_grow: Whether ``store`` takes smaller batches too, as whole parts of the largest.
    """

    policy: TensorDictModuleBase
    explore: TensorDictModuleBase
    loss: LossModule
    terms: Callable[[TensorDictBase], TensorDictBase]
    loss_keys: tuple[str, ...]
    columns: dict[str, str]
    optimizer: torch.optim.Optimizer
    max_grad_norm: float
    store: Callable[[TensorDictBase], None]
    samples: Callable[[], Iterable[TensorDictBase]]
    after_step: Callable[[TensorDictBase], None]
    schedule: Callable[[float], dict[str, float]]
    keeps: Mapping[str, Stateful] = field(default_factory=dict)
    batches_grow: bool = False
