"""One process at a time trains into a run folder."""

import fcntl
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
        self._file = (run / ".lock").open("w")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise RunFolderInUse(f"{run} is in use: another process trains into it") from None

    def release(self) -> None:
        """Release the lock."""
        self._file.close()
