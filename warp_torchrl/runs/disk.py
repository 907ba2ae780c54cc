"""Files that last: on the disk when a call returns, replaced whole or not at all, and a refusal told with its path."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

import torch


def sync(path: Path) -> None:
    """Wait until a file's content, or a folder's list of names, is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def replace(path: Path, text: str) -> None:
    """Write a file so that a reader, or the next start after a crash, finds the old one or the new one.

    Raises:
        OSError: With the path; the old file stays.
    """
    draft = path.with_name(f".{path.name}.tmp")
    try:
        with with_path(path):
            draft.write_text(text, encoding="utf-8", newline="")
            sync(draft)
            draft.replace(path)
            sync(path.parent)
    finally:
        draft.unlink(missing_ok=True)


def save_tensors(path: Path, content: Any) -> None:
    """Write tensors and plain values with ``torch.save``, of a tensor that is part of another that part alone.

    Raises:
        OSError: With the path, where torch says only that its position is not the one that it expected.
    """
    with with_path(path), path.open("wb") as file:
        writer = _Writer(file)
        try:
            torch.save(_apart(content), cast(BinaryIO, writer))
        except RuntimeError:
            if writer.refusal is None:
                raise
            raise writer.refusal from None


def size(content: Any) -> int:
    """Return how many bytes the tensors in nested mappings hold."""
    if isinstance(content, dict):
        return sum(size(each) for each in content.values())
    return content.nbytes if isinstance(content, torch.Tensor) else 0


def _apart(content: Any) -> Any:
    """Return nested mappings with their tensors on their own: torch writes all the memory that a tensor is part of."""
    if isinstance(content, dict):
        return {key: _apart(each) for key, each in content.items()}
    is_part = isinstance(content, torch.Tensor) and content.nbytes < content.untyped_storage().nbytes()
    return content.clone() if is_part else content


@contextmanager
def with_path(path: Path) -> Iterator[None]:
    """Give an OSError the path, which Python leaves out where a write fails."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


class _Writer:
    """A file that remembers why the disk refused a write."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.refusal: OSError | None = None

    def write(self, data: bytes) -> int:
        """Write."""
        try:
            return self._file.write(data)
        except OSError as error:
            self.refusal = error
            raise

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""
        self._file.flush()
