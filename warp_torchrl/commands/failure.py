"""The end of a failed command: one line on stderr, and an exit code for the kind of error."""

import errno
import sys
import traceback
from pathlib import Path
from signal import Signals

from warp_torchrl.algorithms.parallel import WorkerDied
from warp_torchrl.runs.config.compose import HYDRA_ERRORS, one_line
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.system.exit_codes import DISK, DONE, IN_USE, MISTAKE, NUMERICAL, UNSOUND
from warp_torchrl.system.foreign_text import error_line
from warp_torchrl.system.interruption import SIGNALED
from warp_torchrl.system.lock import RunFolderInUse
from warp_torchrl.system.signals import Stopped, left_by
from warp_torchrl.training.finite import NumericalFailure

__all__ = ["DISK", "DONE", "IN_USE", "MISTAKE", "NUMERICAL", "UNSOUND", "fail"]
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)


def fail(error: Exception, debug: bool) -> tuple[int, str]:
    """Print the error as the last line of stderr; return the exit code and the line.

    If a signal caused the error, it prints nothing: the signal was reported already.
    """
    if left_by():
        return SIGNALED + left_by(), f"stopped by signal {Signals(left_by()).name}"
    if debug:
        traceback.print_exc()
    code, line = _diagnose(error)
    line = error_line(line)
    print(line, file=sys.stderr, flush=True)
    return code, line.removeprefix("error: ")


def _diagnose(error: Exception) -> tuple[int, str]:
    text = one_line(error) if isinstance(error, HYDRA_ERRORS) else str(error)
    line = " ".join(text.split()) or type(error).__name__
    if isinstance(error, Stopped):
        return SIGNALED + error.number, line
    if isinstance(error, RunFolderInUse):
        return IN_USE, line
    if isinstance(error, Unsound):
        return UNSOUND, line
    if isinstance(error, NumericalFailure):
        return NUMERICAL, line
    if isinstance(error, WorkerDied):
        return 1, line
    if isinstance(error.__cause__, OSError):  # logging hides the reason in the cause
        error = error.__cause__
    if isinstance(error, OSError) and (error.filename is not None or error.errno in _NO_ROOM):
        return DISK, f"{error.filename or Path.cwd()}: {error.strerror}"
    if isinstance(error, (ConfigError, ValueError, *HYDRA_ERRORS)):
        return MISTAKE, line
    if isinstance(error, MemoryError) or "can't allocate memory" in line:
        return MISTAKE, "memory is full: a smaller map, fewer hours or fewer at once want less"
    return 1, f"{type(error).__name__}: {line} (debug=true shows where)"
