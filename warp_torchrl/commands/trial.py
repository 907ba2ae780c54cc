"""A training of a search or of a live page: as ``train.py``, but it saves and ends when what started it has ended."""

import os
import signal
import sys
import threading

from warp_torchrl.commands.command import train


def main() -> None:
    """Train what the command line asks for, and watch standard input for its end."""
    threading.Thread(target=_end_with_the_starter, daemon=True).start()
    train()


def _end_with_the_starter() -> None:
    os.read(sys.stdin.fileno(), 1)  # nothing is ever written to it
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
