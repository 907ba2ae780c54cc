"""Serialisation of the messages between processes: tensors and plain values.

They are written and read as checkpoints are, so nothing that is received can run code.
"""

import io
from typing import Any

import torch

MOST_BYTES = 2**36
"""Of a message; more than any run's state has."""
HEADER = 8
"""Bytes that hold the size of what follows."""


def serialised(value: Any) -> memoryview:
    """Return a value as bytes."""
    held = io.BytesIO()
    torch.save(value, held)
    return held.getbuffer()


def deserialised(message: bytes | bytearray | memoryview) -> Any:
    """Return the value that ``serialised`` has made bytes of, with its tensors on the CPU.

    Raises:
        UnpicklingError: If it holds anything but plain values.
    """
    return torch.load(io.BytesIO(message), weights_only=True, map_location="cpu")


def message_header(size: int) -> bytes:
    """Return the bytes that announce a message."""
    return size.to_bytes(HEADER, "little")


def announced(head: bytes | bytearray) -> int:
    """Return the size that a header announces.

    Raises:
        RuntimeError: If a message must not be that large.
    """
    size = int.from_bytes(head, "little")
    if size > MOST_BYTES:
        raise RuntimeError(f"a message must have at most {MOST_BYTES} bytes, got one of {size}")
    return size
