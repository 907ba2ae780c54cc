"""A training of a search: as ``train.py``, but it saves and ends when the search that started it has ended."""

import os
import signal
import sys
import threading

from warp_torchrl.commands.command import train


def main() -> None:
    """Train what the command line asks for, and watch standard input for its end."""
    threading.Thread(target=_end_with_the_search, daemon=True).start()
    train()


def _end_with_the_search() -> None:
    os.read(sys.stdin.fileno(), 1)  # nothing is ever written to it
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
