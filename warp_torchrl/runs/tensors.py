"""Tensors that a file holds: none of their numbers may be NaN or infinite."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from torch import Tensor

from warp_torchrl.finite import not_finite
from warp_torchrl.runs.sealed import Unsound


def check_finite(path: Path, content: Any) -> None:
    """Check that all numbers that a file holds are finite.

    Args:
        path: The file.
        content: Tensors and plain values, in nested mappings and sequences.

    Raises:
        Unsound: If one is not; the message names the file and the first such tensor.
    """
    for name, value in numbers(content):
        if (found := not_finite(value)) is not None:
            raise Unsound(f"{path} must hold finite numbers alone, and {name} holds {found:g}")


def numbers(content: Any, prefix: str = "") -> Iterator[tuple[str, Tensor | float]]:
    """Yield each tensor and each plain floating-point number of nested mappings and sequences, by its name."""
    if isinstance(content, Tensor | float):
        yield prefix or "it", content
    elif isinstance(content, dict | list | tuple):
        for name, each in content.items() if isinstance(content, dict) else enumerate(content):
            yield from numbers(each, f"{prefix}.{name}" if prefix else str(name))
