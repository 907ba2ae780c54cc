"""Watch on the parent process: a worker ends when its parent has ended.

``python -P parent.py PID SECONDS MODULE [ARGUMENT ...]`` runs a module as ``python -m`` does, and watches before it
imports anything: imports take seconds, and whoever started it may be killed in them. So this file needs nothing
of ours.
"""

import os
import runpy
import signal
import sys
import threading
import time
from collections.abc import Sequence

SECONDS_BETWEEN_LOOKS = 0.25
SECONDS_TO_SAVE = 20.0
"""What a training has to save in when whoever started it has ended."""
_LEFT_TO_THE_PARENT = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")  # a terminal or a queue sends them to all

_BOUND = "WARP_TORCHRL_PARENT"
_parent: int | None = None


def command(module: str, arguments: Sequence[str], seconds_to_save: float = 0.0) -> list[str]:
    """Return the command line that runs a module in a process which ends with this one, see ``end_with``."""
    return [sys.executable, "-P", __file__, str(os.getpid()), str(seconds_to_save), module, *arguments]


def environment() -> dict[str, str]:
    """Return this process's environment, with the folders from which such a process imports as this one does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def end_with(parent: int, seconds_to_save: float = 0.0) -> None:
    """Let this process end when its parent has.

    Args:
        parent: Its number: a process whose parent has ended gets another one.
        seconds_to_save: In which it may end by itself, asked by SIGTERM; 0 ends it at once.
    """
    global _parent
    is_watched, _parent = _parent == parent, parent
    if os.getppid() != parent:  # it has ended before this process could look
        os._exit(128 + signal.SIGTERM)
    if not is_watched:
        threading.Thread(target=_watch, args=(parent, seconds_to_save), name="parent", daemon=True).start()


def is_child() -> bool:
    """Return whether this process was started by ``command``."""
    return __file__ in sys.orig_argv


def bind_workers(seconds_to_save: float = 0.0) -> None:
    """Let processes that a library starts for this one end with it, from their import of this package on."""
    os.environ[_BOUND] = f"{os.getpid()} {seconds_to_save}"


def end_with_binder() -> None:
    """Let this process end with its parent, if that called ``bind_workers``; now, if the parent has ended."""
    bound, _, seconds_to_save = os.environ.get(_BOUND, "").partition(" ")
    parent = int(bound) if bound.isdigit() else None
    if parent is not None and (parent == os.getppid() or not _exists(parent)):
        end_with(parent, float(seconds_to_save))


def _exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's, which has got its number
        return True
    return True


def is_orphaned() -> bool:
    """Return whether the parent with which this process ends has ended."""
    return _parent is not None and os.getppid() != _parent


def _watch(parent: int, seconds_to_save: float) -> None:
    while os.getppid() == parent:
        time.sleep(SECONDS_BETWEEN_LOOKS)
    if seconds_to_save:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(seconds_to_save)
    os._exit(128 + signal.SIGTERM)


def _run(parent: int, seconds_to_save: float, module: str, arguments: Sequence[str]) -> None:
    """Run a module; signals are for the parent to obey where this process has nothing to save."""
    end_with(parent, seconds_to_save)
    if not seconds_to_save:
        for name in _LEFT_TO_THE_PARENT:
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _run(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3], sys.argv[4:])
