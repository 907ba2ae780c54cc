"""The line and the exit code of a command that a signal ends, and its end while it still imports.

Imports take seconds, in which nothing is there to be saved.
"""

import multiprocessing
import os
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

SIGNALED = 128
"""What is added to a signal's number for the exit code."""
_STDERR = 2
_SCRIPTS = ("train.py", "evaluate.py")  # beside the package in a checkout
_INSTALLED = ("warp-train", "warp-evaluate")


def tell(number: int) -> None:
    """Write the line of a command that a signal ends: not by print, which the signal may have interrupted."""
    os.write(_STDERR, f"error: stopped by signal {signal.Signals(number).name}\n".encode())


def end_on_signal() -> None:
    """Let Ctrl-C and SIGTERM end this process at once, with one line."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)


def _end(number: int, frame: FrameType | None) -> None:
    tell(number)
    os._exit(SIGNALED + number)


def is_command() -> bool:
    """Return whether this process runs one of our commands, and is not the worker of one."""
    if multiprocessing.parent_process() is not None or threading.current_thread() is not threading.main_thread():
        return False
    if sys.argv[:1] == ["-m"]:  # while Python looks for the module
        module = sys.orig_argv[sys.orig_argv.index("-m") + 1 :][:1]
        return bool(module) and module[0].partition(".")[0] == __package__
    program = Path(sys.argv[0] if sys.argv else "")
    return program.name in _INSTALLED or program.resolve() in [
        Path(__file__).parents[1] / script for script in _SCRIPTS
    ]
