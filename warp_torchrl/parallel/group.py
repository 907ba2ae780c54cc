"""What the processes of a run tell each other: collective operations of ``torch.distributed``.

A run of one process has no group, and then these functions do nothing. Every process must call them in the same order.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor
from torch import distributed as dist

Given = ParamSpec("Given")
Told = TypeVar("Told")


class WorkerDied(Exception):  # noqa: N818
    """A process that works for this run ended unexpectedly."""


def size() -> int:
    """Return the number of processes that learn together."""
    return dist.get_world_size() if dist.is_available() and dist.is_initialized() else 1


def rank() -> int:
    """Return this process's number; process 0 writes the run folder."""
    return dist.get_rank() if size() > 1 else 0


def _collective(operation: Callable[Given, Told]) -> Callable[Given, Told]:
    """Let an operation tell that another process has ended; torch has no type of its own for that."""

    @wraps(operation)
    def told(*args: Given.args, **kwargs: Given.kwargs) -> Told:
        try:
            return operation(*args, **kwargs)
        except RuntimeError as error:
            raise WorkerDied(f"a process of the run has ended: {next(iter(str(error).splitlines()), '')}") from error

    return told


@_collective
def sum_(tensor: Tensor) -> Tensor:
    """Replace a tensor by its sum over the processes, in place, and return it."""
    if size() > 1:
        dist.all_reduce(tensor)
    return tensor


@_collective
def mean_(tensors: Iterable[Tensor]) -> None:
    """Replace tensors of one type by their means over the processes, in place, with one message for all."""
    if size() == 1:
        return
    several = list(tensors)
    flat = torch.cat([each.reshape(-1) for each in several])
    dist.all_reduce(flat)
    flat /= size()
    for each, part in zip(several, flat.split([each.numel() for each in several]), strict=True):
        each.copy_(part.view_as(each))


@_collective
def share(value: Any) -> Any:
    """Return process 0's value in every process."""
    if size() == 1:
        return value
    held = [value if rank() == 0 else None]
    dist.broadcast_object_list(held)
    return held[0]


@_collective
def gather(value: Any) -> list[Any]:
    """Return the values of all processes in process 0, and nothing in the others."""
    if size() == 1:
        return [value]
    held = [None] * size() if rank() == 0 else None
    dist.gather_object(value, held)
    return held or []


def standardised(parts: Sequence[Tensor], dim: int) -> list[Tensor]:
    """Return values less their mean, over their standard deviation, both over all processes, with one message.

    As TorchRL standardises advantages: for each index of one dimension by itself, the variance over n - 1.

    Args:
        parts: Each is standardised by itself; float32 [..., A, 1], of one shape in every process.
        dim: The dimension whose indices stay apart.
    """
    others = [each for each in range(parts[0].dim()) if each != dim % parts[0].dim()]
    wide = [each.double() for each in parts]  # so that a difference of sums keeps its digits
    sums = [torch.stack([each.sum(others, keepdim=True), each.square().sum(others, keepdim=True)]) for each in wide]
    found = []
    for each, (total, squares), given in zip(wide, sum_(torch.stack(sums)), parts, strict=True):
        count = each.numel() // each.shape[dim] * size()
        mean = total / count
        variance = (squares - total * mean) / max(count - 1, 1)
        scale = variance.clamp(min=0.0).sqrt().clamp(min=torch.finfo(torch.float32).resolution)
        found.append(((each - mean) / scale).to(given.dtype))
    return found
