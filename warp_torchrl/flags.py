"""Flags of the commands that read their command line by ``argparse``: a mistake is one line, as everywhere."""

import argparse
from typing import NoReturn

from warp_torchrl.foreign_text import plain_text

MISTAKE = 2
_LONGEST = 4000  # characters of a line


class FlagParser(argparse.ArgumentParser):
    """A parser that tells a mistake in one line."""

    def error(self, message: str) -> NoReturn:
        """End the process with the line and the exit code of a mistake."""
        self.exit(MISTAKE, f"error: {plain_text(message, _LONGEST)}\n")
