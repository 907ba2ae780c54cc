"""Training in a separate process, which ends with the search or live page that started it."""

import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from warp_torchrl.system.parent import SECONDS_TO_SAVE, command, environment

MODULE = "warp_torchrl"
"""What the process runs, as ``python -m``, with the command ``train``."""
STOPPED = 128 + signal.SIGTERM
"""Exit code of a training that ``stop`` has stopped."""
_STDERR = "stderr.txt"


class SearchEnded(Exception):  # noqa: N818
    """A search ended before its last trial.

    Attributes:
        code: Exit code of the command.
    """

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class StartedTraining(Protocol):
    """A started training."""

    def poll(self) -> int | None:
        """Return its exit code; None while it runs."""
        ...

    def stop(self) -> None:
        """Let it save and end; a second call ends it at once."""
        ...

    def reason(self) -> str:
        """Return why it failed, in one line."""
        ...


class TrainingProcess:
    """A training in a run folder.

    It has a separate process group, so that a terminal's Ctrl-C reaches it only through the search. When the search
    ends, in any way, it saves and ends too.

    Args:
        overrides: As for ``train.py``.
        folder: Its run folder.
        threads: Threads of torch; None leaves it to the machine.
    """

    def __init__(self, overrides: Sequence[str], folder: Path, threads: int | None) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._errors = folder / _STDERR
        with self._errors.open("wb") as errors:
            self._process = subprocess.Popen(
                command(MODULE, ["train", *overrides], SECONDS_TO_SAVE),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # its log is in its folder
                stderr=errors,
                env=environment() | ({} if threads is None else {"OMP_NUM_THREADS": str(threads)}),
                start_new_session=True,
            )

    def poll(self) -> int | None:
        """Return its exit code; None while it runs. If a signal killed the process it is 128 + the signal."""
        code = self._process.poll()
        return 128 - code if code is not None and code < 0 else code

    def stop(self) -> None:
        """Let it save and end; a second call ends it at once."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)

    def reason(self) -> str:
        """Return the last line that it wrote to stderr."""
        lines = self._errors.read_text(encoding="utf-8", errors="replace").split("\n")
        last = next((line for line in reversed(lines) if line.strip()), "it said nothing")
        return last.strip().removeprefix("error: ")
