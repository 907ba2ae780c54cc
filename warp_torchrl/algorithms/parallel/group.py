"""Collectives between the processes of a run: sums, means and values.

A run of one process has no group, and then these functions do nothing. Every process must call them in the same order.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import Any, ParamSpec, Protocol, TypeVar

import torch
from torch import Tensor

from warp_torchrl.algorithms.parallel.messages import deserialised, serialised

Given = ParamSpec("Given")
Result = TypeVar("Result")


class WorkerDied(Exception):  # noqa: N818
    """A process that works for this run ended unexpectedly."""


class Group(Protocol):
    """The processes of a run, and their connection.

    Attributes:
        rank: Number of this process; process 0 writes the run folder.
        size: Number of all.
    """

    rank: int
    size: int

    def sum_(self, tensor: Tensor) -> None:
        """Replace a tensor by its sum over the processes."""
        ...

    def broadcast(self, message: memoryview | None) -> memoryview:
        """Return the first process's message in every process; the others give none."""
        ...

    def gather(self, message: memoryview) -> list[memoryview]:
        """Return the messages of all processes in the first one, and nothing in the others."""
        ...

    def close(self) -> None:
        """Leave the group."""
        ...


_group: Group | None = None


def enter(group: Group) -> None:
    """Let this process be one of a group."""
    global _group
    _group = group


def leave() -> None:
    """Let this process be alone again."""
    global _group
    left, _group = _group, None
    if left is not None:
        left.close()


def size() -> int:
    """Return the number of processes that learn together."""
    return 1 if _group is None else _group.size


def rank() -> int:
    """Return this process's number; process 0 writes the run folder."""
    return 0 if _group is None else _group.rank


def _collective(operation: Callable[Given, Result]) -> Callable[Given, Result]:
    """Convert errors of an operation to ``WorkerDied``; torch has no type for the end of another process."""

    @wraps(operation)
    def told(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        try:
            return operation(*args, **kwargs)
        except (RuntimeError, OSError) as error:
            raise WorkerDied(f"a process of the run has ended: {next(iter(str(error).splitlines()), '')}") from error

    return told


@_collective
def sum_(tensor: Tensor) -> Tensor:
    """Replace a tensor by its sum over the processes, in place, and return it."""
    if _group is not None:
        _group.sum_(tensor)
    return tensor


@_collective
def mean_(tensors: Iterable[Tensor]) -> None:
    """Replace tensors of one type by their means over the processes, in place, with one message for all."""
    if _group is None:
        return
    several = list(tensors)
    flat = torch.cat([each.reshape(-1) for each in several])
    _group.sum_(flat)
    flat /= _group.size
    for each, part in zip(several, flat.split([each.numel() for each in several]), strict=True):
        each.copy_(part.view_as(each))


@_collective
def share(value: Any) -> Any:
    """Return process 0's value in every process."""
    if _group is None:
        return value
    if _group.rank:
        return deserialised(_group.broadcast(None))
    _group.broadcast(serialised(value))
    return value


@_collective
def gather(value: Any) -> list[Any]:
    """Return the values of all processes in process 0, and nothing in the others."""
    if _group is None:
        return [value]
    found = _group.gather(serialised(value))
    return [value, *map(deserialised, found[1:])] if found else []


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
