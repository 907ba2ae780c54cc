"""Collectives over inherited socket pairs, between processes of one machine.

A process inherits its end when it is started. Nothing listens, so no other user and no other machine can join or listen
in. The first process has a pair with each of the others, and all messages pass through it.
"""

import os
import socket
import tempfile
from collections.abc import Sequence
from datetime import timedelta

import torch
from torch import Tensor
from torch import distributed as dist
from torch.distributed import FileStore  # type: ignore[attr-defined]  # torch does not say that it exports it

from warp_torchrl.algorithms.parallel.messages import HEADER, announced, message_header

_LOOPBACK = "lo"  # the interface by which NCCL talks on one machine
_WAIT = timedelta(days=1)  # a process that has ended is noticed at once; others may wait for an evaluation


class Sockets:
    """The processes of a run on one machine.

    Args:
        rank: Number of this process.
        size: Number of all.
        ends: Of the pairs: in the first process one for each other process, in the others the one to the first.
    """

    def __init__(self, rank: int, size: int, ends: Sequence[socket.socket]) -> None:
        self.rank, self.size, self._ends = rank, size, ends

    def sum_(self, tensor: Tensor) -> None:
        """Replace a tensor by its sum over the processes: in the order of their numbers, so that it repeats."""
        if tensor.device.type != "cpu":
            self._sum_on_gpus(tensor)
            return
        whole = tensor.detach().contiguous()
        for end in self._ends:
            if self.rank:
                _send(end, _bytes_of(whole))
                _receive_into(end, _bytes_of(whole))
            else:
                part = torch.empty_like(whole)
                _receive_into(end, _bytes_of(part))
                whole += part
        if not self.rank:
            self._send_all(_bytes_of(whole))
        if whole.data_ptr() != tensor.data_ptr():
            tensor.detach().copy_(whole)

    def broadcast(self, message: memoryview | None) -> memoryview:
        """Return the first process's message in every process."""
        if message is None:
            return _receive(self._ends[0])
        self._send_all(message)
        return message

    def gather(self, message: memoryview) -> list[memoryview]:
        """Return the messages of all processes in the first one, and nothing in the others."""
        if self.rank:
            _send(self._ends[0], message)
            return []
        return [message, *map(_receive, self._ends)]

    def close(self) -> None:
        """Hang up."""
        if dist.is_available() and dist.is_initialized():
            dist.destroy_process_group()
        for end in self._ends:
            end.close()

    def _sum_on_gpus(self, tensor: Tensor) -> None:
        """Sum by NCCL, whose processes meet once, in a folder that other users cannot read."""
        if dist.is_initialized():
            dist.all_reduce(tensor)
            return
        os.environ["NCCL_SOCKET_IFNAME"] = _LOOPBACK
        with tempfile.TemporaryDirectory(prefix="warp_torchrl-") as own:  # its mode is 0700
            folder = bytes(self.broadcast(None if self.rank else memoryview(own.encode()))).decode()
            store = FileStore(f"{folder}/store", self.size)
            dist.init_process_group("nccl", store=store, rank=self.rank, world_size=self.size, timeout=_WAIT)
            dist.all_reduce(tensor)
            self.gather(memoryview(b""))  # all have met

    def _send_all(self, message: memoryview) -> None:
        for end in self._ends:
            _send(end, message)


def pairs(count: int) -> tuple[list[socket.socket], list[socket.socket]]:
    """Return the ends of ``count`` pairs: the ends of the first process, and the ends of the others."""
    made = [socket.socketpair() for _ in range(count)]
    return [own for own, _ in made], [given for _, given in made]


def inherited(number: int) -> socket.socket:
    """Return the socket that this process inherited under a number; its children do not inherit it."""
    end = socket.socket(fileno=number)
    end.set_inheritable(False)
    return end


def _bytes_of(tensor: Tensor) -> memoryview:
    """Return the bytes of a contiguous tensor on the CPU, not a copy of them."""
    return tensor.reshape(-1).view(torch.uint8).numpy().data


def _send(end: socket.socket, message: memoryview) -> None:
    end.sendall(message_header(message.nbytes))
    end.sendall(message)


def _receive(end: socket.socket) -> memoryview:
    """Return a message."""
    message = memoryview(bytearray(_next_size(end)))
    _fill(end, message)
    return message


def _receive_into(end: socket.socket, place: memoryview) -> None:
    """Receive a message whose size is known.

    Raises:
        RuntimeError: If it has another size.
    """
    size = _next_size(end)
    if size != place.nbytes:
        raise RuntimeError(f"a message must have {place.nbytes} bytes here, got {size}")
    _fill(end, place)


def _next_size(end: socket.socket) -> int:
    head = bytearray(HEADER)
    _fill(end, memoryview(head))
    return announced(head)


def _fill(end: socket.socket, place: memoryview) -> None:
    """Fill a buffer with received bytes.

    Raises:
        ConnectionError: If the other process has ended.
    """
    while place.nbytes:
        count = end.recv_into(place)
        if not count:
            raise ConnectionError("the connection is closed")
        place = place[count:]
