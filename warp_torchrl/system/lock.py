"""One process at a time writes into a run folder."""

import fcntl
import os
from pathlib import Path


class RunFolderInUse(Exception):  # noqa: N818
    """Another process writes into the run folder."""


class RunFolderLock:
    """Locks a run folder for one process; the operating system releases the lock when the process ends.

    Raises:
        RunFolderInUse: If another process has the lock.
    """

    def __init__(self, run: Path) -> None:
        run.mkdir(parents=True, exist_ok=True)
        self._descriptor = _locked(run / ".lock")
        if self._descriptor is None:
            raise RunFolderInUse(f"{run} is in use: another process writes into it")

    def release(self) -> None:
        """Release the lock; once more does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _locked(path: Path) -> int | None:
    """Return the descriptor of a locked file, which stands under its name; None where another process has the lock."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_named(path, descriptor):
                return descriptor
        except BlockingIOError:
            os.close(descriptor)
            return None
        os.close(descriptor)  # it was removed before it was locked


def _is_named(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
