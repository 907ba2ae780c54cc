"""Checked reading of ``torch.save`` files: bounded sizes, plain tensors, finite numbers."""

import os
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import torch
from torch import Tensor

from warp_torchrl.system import foreign
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.system.finite import not_finite

_LARGEST_DIRECTORY = 2**24  # bytes
_END, _END_64, _LOCATOR_64 = struct.Struct("<4s4H2LH"), struct.Struct("<4sQ2H2L4Q"), struct.Struct("<4sLQL")
_MOST_PARTS = 1_000_000
_DEEPEST = 50
_SHARED = 8
"""Under so many names the numbers of a file may be there."""


def largest() -> int:
    """Return the largest size of a file of tensors that is read, this machine's memory [bytes]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def load_tensors(path: Path) -> Any:
    """Return the tensors and plain values of a file that ``torch.save`` wrote, on the CPU.

    The file is checked before memory is allocated for it: its parts are uncompressed and no larger than the file, so
    that none unpacks to more, and no tensor has more numbers than its storage.

    Raises:
        Unsound: If the file is none of these, or cannot be read.
    """
    try:
        with foreign.open_file(path, largest()) as file:
            length = os.fstat(file.fileno()).st_size
            _check_archive(file, length)
            file.seek(0)
            content = torch.load(file, weights_only=True, map_location="cpu")
            _check_sizes(content, length)
    except Exception as error:  # torch raises many types for what it does not read
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise Unsound(f"{path} cannot be read: {reason}") from None
    return content


def _check_archive(file: BinaryIO, length: int) -> None:
    """Check that a ZIP archive's parts are uncompressed, and are no larger than the archive.

    Raises:
        ValueError: If they are not.
    """
    _check_directory(file, length)
    with zipfile.ZipFile(file) as archive:
        parts = archive.infolist()
    if any(each.compress_type != zipfile.ZIP_STORED or each.compress_size != each.file_size for each in parts):
        raise ValueError("its parts must be stored as they are, and one is compressed")
    if sum(each.file_size for each in parts) > length or len({each.filename for each in parts}) < len(parts):
        raise ValueError("its parts must be apart from each other, and no larger than the file")


def _check_directory(file: BinaryIO, length: int) -> None:
    """Check that a ZIP archive ends with the one list of its parts, which every reader then finds.

    Raises:
        ValueError: If it does not.
    """
    file.seek(max(0, length - _END.size - _LOCATOR_64.size - _END_64.size))
    tail = file.read()
    end, start_of_end = tail[-_END.size :], length - _END.size
    if len(end) < _END.size or not end.startswith(b"PK\5\6"):
        raise ValueError("it is no archive of torch.save")
    *_, size, start, comment = _END.unpack(end)
    locator = tail[-_END.size - _LOCATOR_64.size : -_END.size]
    if locator.startswith(b"PK\6\7"):
        start_of_end -= _LOCATOR_64.size + _END_64.size
        _, _, place, _ = _LOCATOR_64.unpack(locator)
        signature, *_, size, start = _END_64.unpack(tail[: _END_64.size])
        if signature != b"PK\6\6" or place != start_of_end:
            raise ValueError("it is no archive of torch.save: its end is not where it says")
    if comment or start + size != start_of_end or size > _LARGEST_DIRECTORY:
        raise ValueError("it is no archive of torch.save: its list of parts is not where it says, or too long")


def _check_sizes(content: Any, length: int) -> None:
    """Check that nested values are plain, and that tensors hold no more numbers than their file.

    Raises:
        ValueError: If they are not.
    """
    total = 0
    for name, value in _parts(content):
        if not isinstance(value, Tensor):
            continue
        is_plain = value.layout is torch.strided and value.device.type == "cpu" and not value.is_quantized
        if not is_plain or value.is_complex():
            raise ValueError(f"{name} must be a plain tensor of real numbers")
        total += value.nbytes
        if value.nbytes > value.untyped_storage().nbytes() or total > _SHARED * length:
            raise ValueError(f"{name} of shape {list(value.shape)} must have no more numbers than the file")


def _parts(content: Any) -> Iterator[tuple[str, Any]]:
    """Yield what nested values hold, by its name.

    Raises:
        ValueError: If there is too much of it, as where a list holds one list many times.
    """
    left, count = [("it", content, 0)], 0
    while left:
        name, value, depth = left.pop()
        yield name, value
        if isinstance(value, dict | list | tuple):
            count += len(value)
            if depth > _DEEPEST or count > _MOST_PARTS:
                raise ValueError(f"it must be nested at most {_DEEPEST} deep, with at most {_MOST_PARTS} values")
            items = value.items() if isinstance(value, dict) else enumerate(value)
            left += [(f"{name}.{key}"[:200] if depth else str(key)[:200], each, depth + 1) for key, each in items]


def check_finite(path: Path, content: Any) -> None:
    """Check that all numbers that a file holds are finite.

    Args:
        path: The file.
        content: Tensors and plain values, in nested mappings and sequences.

    Raises:
        Unsound: If one is not; the message names the file and the first such tensor.
    """
    for name, value in float_values(content):
        if (found := not_finite(value)) is not None:
            raise Unsound(f"{path} must hold finite numbers alone, and {name} holds {found:g}")


def float_values(content: Any, prefix: str = "") -> Iterator[tuple[str, Tensor | float]]:
    """Yield each tensor and each plain floating-point number of nested mappings and sequences, by its name."""
    if isinstance(content, Tensor | float):
        yield prefix or "it", content
    elif isinstance(content, dict | list | tuple):
        for name, each in content.items() if isinstance(content, dict) else enumerate(content):
            yield from float_values(each, f"{prefix}.{name}" if prefix else str(name))
