"""Whether a program may read back from the device that it computes on.

A CPU's memory is read for nothing. A GPU computes while the program goes on, and to read from it is to wait until all
is done that was asked of it; so what is computed there has sizes that no result decides.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_unread = False


def reads_freely(device: torch.device) -> bool:
    """Return whether to read from a device costs nothing, which it does on a CPU alone."""
    return device.type == "cpu" and not _unread


def is_same(one: torch.device, other: torch.device | None) -> bool:
    """Return whether two devices are one: of a CPU torch tells no index, whatever it was given."""
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
