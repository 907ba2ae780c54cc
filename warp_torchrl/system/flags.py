"""Argument parser of the commands with flags: an error is one line."""

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from warp_torchrl.system.foreign_text import plain_text

MISTAKE = 2
_LONGEST = 4000  # characters of a line


def whole(low: int, high: int) -> Callable[[str], int]:
    """Return a ``type`` for a flag that is a whole number in a range."""

    def number(given: str) -> int:
        if not (given.isascii() and given.isdigit() and len(given) <= len(str(high)) and low <= int(given) <= high):
            raise argparse.ArgumentTypeError(f"must be a whole number in {low}..{high}, got {given}")
        return int(given)

    return number


def file_to_write(given: str) -> Path:
    """Return the path of a file that can be made; a ``type`` for a flag, so that it fails before hours of work.

    Raises:
        argparse.ArgumentTypeError: If it is a folder, or in none.
    """
    path = Path(given)
    if path.is_dir() or not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise argparse.ArgumentTypeError(f"must be a file in a folder that can be written to, got {given}")
    return path


class FlagParser(argparse.ArgumentParser):
    """A parser that reports an error in one line; flags cannot be abbreviated."""

    def __init__(self, *, prog: str, description: str | None = None) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """End the process with the line and the exit code of a mistake."""
        self.exit(MISTAKE, f"error: {plain_text(message, _LONGEST)}\n")
