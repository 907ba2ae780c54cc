"""Collectives over torch's process group under ``torchrun``: Gloo between CPUs, NCCL between GPUs.

They meet at the address that ``torchrun`` was given, and trust whoever can reach it: see ``docs/performance.md``.
"""

import os
from datetime import timedelta

import torch
from torch import Tensor
from torch import distributed as dist

from warp_torchrl.algorithms.parallel.messages import HEADER, announced, message_header

_WAIT = timedelta(days=1)  # a process that has ended is noticed at once; others may wait for an evaluation


def is_torchrun() -> bool:
    """Return whether ``torchrun`` has started this process."""
    return "TORCHELASTIC_RUN_ID" in os.environ


def torchrun_rank() -> int:
    """Return the number that ``torchrun`` has given this process; 0 without it."""
    return int(os.environ["RANK"]) if is_torchrun() else 0


class Torchrun:
    """The processes of a run that ``torchrun`` has started."""

    def __init__(self) -> None:
        backend = "cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "gloo"
        dist.init_process_group(backend, timeout=_WAIT)
        self.rank, self.size = dist.get_rank(), dist.get_world_size()

    def sum_(self, tensor: Tensor) -> None:
        """Replace a tensor by its sum over the processes."""
        dist.all_reduce(tensor)

    def broadcast(self, message: memoryview | None) -> memoryview:
        """Return the first process's message in every process."""
        head = _tensor(message_header(0 if message is None else message.nbytes))
        dist.broadcast(head, 0)
        held = _empty(head) if message is None else _tensor(message)
        dist.broadcast(held, 0)
        return held.numpy().data if message is None else message

    def gather(self, message: memoryview) -> list[memoryview]:
        """Return the messages of all processes in the first one, and nothing in the others."""
        if self.rank:
            dist.send(_tensor(message_header(message.nbytes)), 0)
            dist.send(_tensor(message), 0)
            return []
        return [message, *(_received(rank) for rank in range(1, self.size))]

    def close(self) -> None:
        """Leave the group."""
        dist.destroy_process_group()


def _received(rank: int) -> memoryview:
    """Return a message of another process."""
    head = torch.empty(HEADER, dtype=torch.uint8)
    dist.recv(head, rank)
    held = _empty(head)
    dist.recv(held, rank)
    return held.numpy().data


def _tensor(message: bytes | memoryview) -> Tensor:
    return torch.frombuffer(bytearray(message), dtype=torch.uint8)


def _empty(head: Tensor) -> Tensor:
    """Return a place for the message that a header announces."""
    return torch.empty(announced(head.numpy().tobytes()), dtype=torch.uint8)
