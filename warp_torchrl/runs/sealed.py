"""Folders that say of themselves what belongs in them: sizes and sha256 of files, in JSON with a sha256 of its own."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

_LARGEST_JSON = 1_000_000
Files = dict[str, dict[str, Any]]
"""Size [bytes] and sha256 by file name."""


class Unsound(Exception):  # noqa: N818
    """A folder lacks a part, or was altered; the message is one line."""


def read_json(path: Path) -> dict[str, Any]:
    """Return the mapping in a JSON file.

    Raises:
        Unsound: If the file cannot be read or holds no mapping.
    """
    try:
        if path.stat().st_size > _LARGEST_JSON:
            raise Unsound(f"{path} is too large to be one of ours")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise Unsound(f"{path} cannot be read: {first_line(error)}") from None
    if not isinstance(content, dict):
        raise Unsound(f"{path} must hold a mapping")
    return content


def sealed(content: Mapping[str, Any]) -> bytes:
    """Return the exact bytes of a JSON file with this content and its sha256."""
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "sha256": digest}, indent=1).encode()


def check_seal(path: Path, content: dict[str, Any]) -> None:
    """Take the sha256 out of what a JSON file holds, and check that the file is what ``sealed`` makes of the rest.

    Raises:
        Unsound: If it is not.
    """
    content.pop("sha256", None)
    if path.read_bytes() != sealed(content):
        raise Unsound(f"{path} was altered: its sha256 is not its own")


def described(folder: Path, names: Iterable[str]) -> Files:
    """Return the size and sha256 of each file."""
    return {name: {"size": (folder / name).stat().st_size, "sha256": _sha256(folder / name)} for name in names}


def check_files(folder: Path, files: Files) -> None:
    """Check every file against its size and sha256.

    Raises:
        Unsound: If one is missing, cut or altered.
    """
    for name, entry in files.items():
        path, size = folder / name, entry["size"]
        if not path.is_file() or path.stat().st_size != size:
            raise Unsound(f"{path} is missing or was cut: {size} bytes are expected")
        if _sha256(path) != entry["sha256"]:
            raise Unsound(f"{path} was altered: its sha256 is not the manifest's")


def first_line(error: Exception) -> str:
    """Return the first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
