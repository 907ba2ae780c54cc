"""What the training loop needs of an algorithm: a record without an algorithm's name."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.data import ReplayBuffer
from torchrl.objectives import LossModule


@dataclass(kw_only=True)
class Learner:
    """An algorithm, ready to learn.

    Attributes:
        policy: Observation and mask in, action out: what is saved and evaluated.
        explore: What the collector runs.
        loss: TorchRL's loss module; it holds every parameter that is trained.
        loss_keys: Entries of its output that are summed and minimised.
        columns: Names of ``metrics.csv`` by entry of the loss's output.
        optimizer: Over the loss's parameters.
        max_grad_norm: Gradients are clipped to this norm.
        prepare: Turns a collected batch [B, T] into what the buffer stores, [n].
        buffer: Where batches go and samples come from.
        keeps_data: Whether the buffer's contents outlive an iteration.
        passes: Samples are drawn until each stored item has been seen this often, on average, in an iteration.
        schedule: Sets what changes with progress in 0..1, and returns it as columns.
    """

    policy: TensorDictModuleBase
    explore: TensorDictModuleBase
    loss: LossModule
    loss_keys: tuple[str, ...]
    columns: dict[str, str]
    optimizer: torch.optim.Optimizer
    max_grad_norm: float
    prepare: Callable[[TensorDictBase], TensorDictBase]
    buffer: ReplayBuffer
    keeps_data: bool
    passes: int
    schedule: Callable[[float], dict[str, float]]
