"""Manifests of folders: sizes and sha256 of their files, in JSON that holds the sha256 of its content."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from io import BufferedReader
from pathlib import Path
from typing import Any

from warp_torchrl.system import foreign

_LARGEST_JSON = 1_000_000
_MOST_FILES = 1000
_SHA256 = 64  # hexadecimal digits
Files = dict[str, dict[str, Any]]
"""Size [bytes] and sha256 by file name."""


class Unsound(Exception):  # noqa: N818
    """A folder without a part, or with an altered one; the message is one line."""


def read_mapping(path: Path) -> dict[str, Any]:
    """Return the mapping in a JSON file.

    Raises:
        Unsound: If the file cannot be read or holds no mapping.
    """
    try:
        content = foreign.read_json(path, _LARGEST_JSON)
    except (OSError, foreign.Foreign) as error:
        raise Unsound(f"{path} cannot be read: {first_line(error)}") from None
    if not isinstance(content, dict):
        raise Unsound(f"{path} must hold a mapping")
    return content


def checksummed(content: Mapping[str, Any]) -> bytes:
    """Return the exact bytes of a JSON file with this content and its sha256."""
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "sha256": digest}, indent=1).encode()


def check_checksum(path: Path, content: dict[str, Any]) -> None:
    """Remove the sha256 from a JSON file's content, and check that ``checksummed`` gives the file's bytes.

    Raises:
        Unsound: If it is not.
    """
    content.pop("sha256", None)
    if foreign.read_bytes(path, _LARGEST_JSON) != checksummed(content):
        raise Unsound(f"{path} was altered: its sha256 is not its own")


def described(folder: Path, names: Iterable[str]) -> Files:
    """Return the size and sha256 of each file."""
    return {name: {"size": (folder / name).stat().st_size, "sha256": _sha256(folder / name)} for name in names}


def checked_files(value: object) -> Files:
    """Return a manifest's sizes and sha256 of files by name, checked.

    Raises:
        ValueError: If it is anything else.
    """
    if not isinstance(value, dict) or len(value) > _MOST_FILES:
        raise ValueError(f"files must be at most {_MOST_FILES}, by their names")
    for name, entry in value.items():
        size, digest = (entry.get(key) if isinstance(entry, dict) else None for key in ("size", "sha256"))
        if type(size) is not int or size < 0 or not isinstance(digest, str) or len(digest) != _SHA256:
            raise ValueError(f"file {name[:80]!r} must have a size and a sha256")
    return value


def check_files(folder: Path, files: Files, most: int) -> None:
    """Check every file against its size and sha256; none is read before the sizes of all are right.

    Args:
        folder: The folder; files are below it, and no links.
        files: What its manifest says.
        most: Size of all files together [bytes].

    Raises:
        Unsound: If one is missing, cut, altered or elsewhere, or they are too large.
    """
    total = sum(entry["size"] for entry in files.values())
    if total > most:
        raise Unsound(f"{folder} says that it holds {total} bytes, and at most {most} are read")
    for name, entry in files.items():
        with _opened(folder, name) as file:
            if os.fstat(file.fileno()).st_size != entry["size"]:
                raise Unsound(f"{folder / name} is missing or was cut: {entry['size']} bytes are expected")
    for name, entry in files.items():
        with _opened(folder, name) as file:
            if hashlib.file_digest(file, "sha256").hexdigest() != entry["sha256"]:
                raise Unsound(f"{folder / name} was altered: its sha256 is not the manifest's")


def first_line(error: Exception) -> str:
    """Return the first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _opened(folder: Path, name: str) -> BufferedReader:
    """Open a file that a manifest names.

    Raises:
        Unsound: If it is not there, or is no regular file below the folder.
    """
    try:
        return foreign.open_file(foreign.path_below(folder, name))
    except foreign.Foreign as error:
        raise Unsound(str(error)) from None
    except OSError as error:
        raise Unsound(f"{folder / name} is missing or was cut: {error.strerror}") from None


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
