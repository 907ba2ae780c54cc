"""An optimiser step as a CUDA graph."""

from collections.abc import Callable

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.system.graph import Graph

Update = Callable[[TensorDictBase], dict[str, Tensor]]


class RecordedUpdate:
    """A function that learns from a sample, recorded as a CUDA graph.

    Numbers that a schedule changes must be tensors: so the learning rate becomes one. There is one graph for each size
    of samples: batches grow, and the last sample of a pass may be smaller.

    Args:
        update: Learns from a sample and returns numbers by name, [] each.
        optimizer: Optimiser of the function.
    """

    def __init__(self, update: Update, optimizer: torch.optim.Optimizer) -> None:
        self._update, self._optimizer = update, optimizer
        self._graphs: dict[torch.Size, Graph] = {}
        self._like: TensorDictBase | None = None
        self._names: list[str] = []

    def __call__(self, sample: TensorDictBase) -> dict[str, Tensor]:
        """Learn from a sample, and return the numbers of the update."""
        if self._like is None:
            _make_capturable(self._optimizer)
        self._like = sample
        graph = self._graphs.setdefault(sample.batch_size, Graph(self._flat))
        made = graph(_leaves(sample))  # names its results
        return dict(zip(self._names, made, strict=True))

    def _flat(self, given: list[Tensor]) -> list[Tensor]:
        if self._like is None:
            raise RuntimeError("a recording is called with no sample")
        leaves = iter(given)
        found = self._update(self._like.apply(lambda _: next(leaves)))
        self._names = sorted(found)
        return [found[name] for name in self._names]


def _leaves(sample: TensorDictBase) -> list[Tensor]:
    found: list[Tensor] = []
    sample.apply(lambda leaf: found.append(leaf), filter_empty=True)
    return found


def _make_capturable(optimizer: torch.optim.Optimizer) -> None:
    """Let a CUDA graph record an optimiser's steps, with a learning rate that may change later."""
    for group in optimizer.param_groups:
        device = group["params"][0].device
        rate = group["lr"]
        group["lr"] = rate if isinstance(rate, Tensor) else torch.tensor(rate, device=device)
        group["capturable"] = device.type == "cuda"
