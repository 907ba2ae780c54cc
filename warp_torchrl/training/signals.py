"""Stop signals: deferred while a run trains, so that it can save first; elsewhere they end the process at once."""

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

_STDERR = 2
_WATCHED = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)


class Stopped(Exception):  # noqa: N818
    """A signal asked the run to stop; it has saved.

    Attributes:
        number: Number of the signal.
    """

    def __init__(self, number: int, run: Path) -> None:
        super().__init__(f"stopped by signal {signal.Signals(number).name}; go on with resume={run}")
        self.number = number


class DeferredSignals:
    """Context that records the first signal; a second one ends the process.

    Attributes:
        received: Number of the first signal; 0 if there was none.
    """

    def __init__(self) -> None:
        self.received = 0

    def __enter__(self) -> "DeferredSignals":
        self._before = _watch(self._note)
        return self

    def __exit__(self, *error: object) -> None:
        _restore(self._before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.received:
            _leave(number, frame)
        self.received = number


@contextmanager
def exit_on_signal() -> Iterator[None]:
    """Within this context a signal ends the process with one line and the signal's exit code."""
    before = _watch(_leave)
    try:
        yield
    finally:
        _restore(before)


def _leave(number: int, frame: FrameType | None) -> None:
    # os.write and not print: the signal may have interrupted a print.
    os.write(_STDERR, f"error: stopped by signal {signal.Signals(number).name}\n".encode())
    raise SystemExit(128 + number)


def _watch(handler: Callable[[int, FrameType | None], None]) -> dict[int, Any]:
    try:
        return {number: signal.signal(number, handler) for number in _WATCHED}
    except ValueError:  # Python allows signal handlers in the main thread only
        return {}


def _restore(handlers: Mapping[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
