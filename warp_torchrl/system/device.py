"""Cost of reading results back from the device.

Reading from a CPU's memory is free. A GPU computes while the program continues, and reading from it waits until all of
its queued work is done (a synchronisation); so on a GPU no result decides the size of a later tensor.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_unread = False


def needs_no_sync(device: torch.device) -> bool:
    """Return whether reading from a device needs no synchronisation, as on a CPU."""
    return device.type == "cpu" and not _unread


def is_same(one: torch.device, other: torch.device | None) -> bool:
    """Return whether two devices are the same; torch gives a CPU no index, whatever index was given."""
    return one == other or (one.type == "cpu" and other is not None and other.type == "cpu")


@contextmanager
def unread() -> Iterator[None]:
    """Compute on a CPU as on a GPU, without reading back: for tests and measurements where there is no GPU."""
    global _unread
    before, _unread = _unread, True
    try:
        yield
    finally:
        _unread = before
