"""Untrusted files: regular files of a bounded size, texts, and JSON by its standard.

Every reader of such a file opens it here, so that no pipe, device or endless file holds a command up.
"""

import json
import os
import re
import stat
from io import BufferedReader
from pathlib import Path
from typing import Any

_PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
_LONGEST_NAME = 1024


class Foreign(ValueError):  # noqa: N818
    """A file is none of the kind that is read; the message is one line that names it."""


def open_file(path: Path, most: int | None = None) -> BufferedReader:
    """Open a regular file to read its bytes; the caller closes it.

    Args:
        path: The file, or a link to it.
        most: Size that it may have [bytes]; None for any.

    Raises:
        Foreign: If it is a folder, a pipe, a socket or a device, or too large.
        OSError: If it cannot be opened.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe without a writer would wait
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise Foreign(f"{path} is no file")
        if most is not None and status.st_size > most:
            raise Foreign(f"{path} is too large: {status.st_size} bytes, at most {most} are read")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_bytes(path: Path, most: int) -> bytes:
    """Return what a regular file holds.

    Args:
        path: The file.
        most: Size that it may have [bytes].

    Raises:
        Foreign: As of ``open_file``; or if the file is longer than it says, as files of the kernel are.
        OSError: If it cannot be read.
    """
    with open_file(path, most) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise Foreign(f"{path} is too large: at most {most} bytes are read")
    return content


def read_text(path: Path, most: int) -> str:
    """Return the text of a UTF-8 file, without a byte order mark.

    Raises:
        Foreign: As of ``read_bytes``; or if it is not UTF-8, or has a NUL.
        OSError: If it cannot be read.
    """
    try:
        text = read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Foreign(f"{path} must be UTF-8: byte {error.start} is not") from None
    if "\0" in text:
        raise Foreign(f"{path} must be a text, and holds a NUL")
    return text


def read_json(path: Path, most: int) -> Any:
    """Return what a JSON file holds, by RFC 8259: no NaN, no infinity, no key twice in one object.

    Raises:
        Foreign: As of ``read_text``; or if it is no such JSON.
        OSError: If it cannot be read.
    """
    try:
        return json.loads(
            read_text(path, most), parse_constant=_refuse_constant, parse_float=_finite, object_pairs_hook=_once
        )
    except Foreign:
        raise
    except RecursionError:
        raise Foreign(f"{path} is no JSON that is read: it is nested too deep") from None
    except ValueError as error:
        raise Foreign(f"{path} is no JSON that is read: {' '.join(str(error).split())}") from None


def path_below(folder: Path, name: str) -> Path:
    """Return the path of a file that a folder's manifest names.

    Args:
        folder: The folder.
        name: Plain names, parted by ``/``: of ``A-Za-z0-9._-``, none begins with a dot or a dash.

    Raises:
        Foreign: If the name leads elsewhere, or a part of the path below the folder is a link.
    """
    parts = name.split("/")
    if len(name) > _LONGEST_NAME or not all(_PART.fullmatch(part) for part in parts):
        raise Foreign(f"{folder} names a file {name[:80]!r}, which is no plain name below it")
    path = folder
    for part in parts:
        path = path / part
        if path.is_symlink():
            raise Foreign(f"{path} is a link, and files below {folder} must be there themselves")
    return path


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def _finite(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"{text[:20]} is too large for a number")
    return value


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"key {twice[:40]!r} is there twice")
    return content
