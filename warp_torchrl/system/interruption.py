"""Exit line and exit code of a command that a signal ends, also during its imports.

Imports take seconds, in which nothing is there to be saved.
"""

import atexit
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from types import FrameType

SIGNALED = 128
"""What is added to a signal's number for the exit code."""
_STDERR = 2
_SCRIPTS = ("train.py", "evaluate.py")  # beside the package in a checkout
_INSTALLED = ("warp",)


def write_signal_line(number: int) -> None:
    """Write the line of a command that a signal ends: not by print, which the signal may have interrupted."""
    os.write(_STDERR, f"error: stopped by signal {signal.Signals(number).name}\n".encode())


def end_on_signal() -> None:
    """Let Ctrl-C and SIGTERM end this process at once, with one line."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)


def watch_end() -> None:
    """Let ``skip_teardown`` work in this process; called before other libraries register exit functions."""
    atexit.register(_end_before_teardown)  # the first of all, and so called last


def skip_teardown(code: int) -> None:
    """End this process with a code after its exit functions, before Python destroys its objects.

    A signal leaves objects half shut down. Their destructors may wait for ever: a weight updater of TorchRL starts a
    thread, which Python does not run any more.
    """
    _Ending.code = code


class _Ending:
    code = 0


def _end_before_teardown() -> None:
    if _Ending.code:
        with suppress(OSError, ValueError):  # nobody reads any more
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(_Ending.code)


def _end(number: int, frame: FrameType | None) -> None:
    write_signal_line(number)
    os._exit(SIGNALED + number)


def is_command() -> bool:
    """Return whether this process runs one of our commands, and is not the worker of one."""
    if threading.current_thread() is not threading.main_thread() or not sys.argv:
        return False
    if sys.argv[0] == "-m":  # while Python looks for the module
        module = sys.orig_argv[sys.orig_argv.index("-m") + 1]
        return module.partition(".")[0] == __package__.partition(".")[0]
    program = Path(sys.argv[0])
    was_started = sys.argv[0] in sys.orig_argv  # of a worker they are the interpreter's, and argv is its parent's
    ours = [Path(__file__).parents[2] / script for script in _SCRIPTS]
    return was_started and (program.name in _INSTALLED or program.resolve() in ours)
