"""Durable, atomic writes; their errors name the path."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

import torch


def sync(path: Path) -> None:
    """Flush a file or a folder to the disk (fsync)."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def replace(path: Path, content: str | bytes) -> None:
    """Replace a file atomically: readers find the old or the new content, also after a crash.

    Args:
        path: The file.
        content: New content; a text is written as UTF-8, its line ends unchanged.

    Raises:
        OSError: If the write fails, with the path; the old file stays.
    """
    with drafted(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """Yield the path of a draft, of a name that no other process has, which takes a file's place when the block ends.

    Its ending is the file's, by which some writers choose a format.

    Raises:
        OSError: If the write fails, with the path; the old file stays.
    """
    draft = path.with_name(f".{path.stem}.{os.getpid()}-{secrets.token_hex(4)}.tmp{path.suffix}")
    try:
        with with_path(path):
            yield draft
            sync(draft)
            draft.replace(path)
            sync(path.parent)
    except OSError as error:
        if error.filename == str(draft):
            error.filename = str(path)
        raise
    finally:
        draft.unlink(missing_ok=True)


def save_tensors(path: Path, content: Any) -> None:
    """Write tensors and plain values with ``torch.save``; a view is written without the rest of its storage.

    Raises:
        OSError: If the write fails, with the path; torch itself reports only an unexpected file position.
    """
    with with_path(path), path.open("wb") as file:
        writer = _Writer(file)
        try:
            torch.save(_apart(content), cast(BinaryIO, writer))
        except RuntimeError:
            if writer.refusal is None:
                raise
            raise writer.refusal from None


def tensors_size(content: Any) -> int:
    """Return the size of the tensors in nested mappings [bytes]."""
    if isinstance(content, dict):
        return sum(tensors_size(each) for each in content.values())
    return content.nbytes if isinstance(content, torch.Tensor) else 0


def _apart(content: Any) -> Any:
    """Return nested mappings with views cloned: torch would write the whole storage of a view."""
    if isinstance(content, dict):
        return {key: _apart(each) for key, each in content.items()}
    is_part = isinstance(content, torch.Tensor) and content.nbytes < content.untyped_storage().nbytes()
    return content.clone() if is_part else content


@contextmanager
def with_path(path: Path) -> Iterator[None]:
    """Add the path to an ``OSError``; Python leaves it out if a write fails."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


class _Writer:
    """A file that keeps the ``OSError`` of a failed write, which torch hides."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.refusal: OSError | None = None

    def write(self, data: bytes) -> int:
        """Write bytes; keep the error if it fails."""
        try:
            return self._file.write(data)
        except OSError as error:
            self.refusal = error
            raise

    def flush(self) -> None:
        """Flush the buffer to the operating system."""
        self._file.flush()
