"""Flags of the commands that read their command line by ``argparse``: a mistake is one line, as everywhere."""

import argparse
from collections.abc import Callable
from typing import NoReturn

from warp_torchrl.foreign_text import plain_text

MISTAKE = 2
_LONGEST = 4000  # characters of a line


def whole(low: int, high: int) -> Callable[[str], int]:
    """Return what reads a whole number in a range, for ``type`` of a flag."""

    def number(given: str) -> int:
        if not (given.isascii() and given.isdigit() and len(given) <= len(str(high)) and low <= int(given) <= high):
            raise argparse.ArgumentTypeError(f"must be a whole number in {low}..{high}, got {given}")
        return int(given)

    return number


class FlagParser(argparse.ArgumentParser):
    """A parser that tells a mistake in one line; flags are written in full."""

    def __init__(self, *, prog: str, description: str | None = None) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """End the process with the line and the exit code of a mistake."""
        self.exit(MISTAKE, f"error: {plain_text(message, _LONGEST)}\n")
