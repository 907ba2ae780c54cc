"""Stop signals: deferred while a run trains, so that it can save first; elsewhere they end the process at once."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from warp_torchrl.system.interruption import SIGNALED, skip_teardown, write_signal_line

_WATCHED = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)
_OF_SUBMITIT = "SUBMITIT_PREEMPT_SIGNAL"  # names the signal that submitit warns by, without SIG; USR2 if it is not set
_SECONDS_TO_END = 60.0  # in which a command cleans up; a library may have caught what should have ended it


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
    _left.number = 0
    before = _watch(_leave)
    try:
        yield
    finally:
        _restore(before)


def left_by() -> int:
    """Return the number of the signal that ends this command; 0 if none does.

    What a signal raises in the middle of a library's work may come out of it as another error.
    """
    return _left.number


class _Left:
    """The signal that ends the command, and the timer that ends it if it does not end by itself."""

    number = 0
    clock: threading.Timer | None = None


_left = _Left()


def _leave(number: int, frame: FrameType | None) -> None:
    write_signal_line(number)
    _left.number = number
    skip_teardown(SIGNALED + number)
    if _left.clock is None:
        _left.clock = threading.Timer(_SECONDS_TO_END, os._exit, (SIGNALED + number,))
        _left.clock.daemon = True
        _left.clock.start()
    raise SystemExit(SIGNALED + number)


def watched() -> tuple[int, ...]:
    """Return the signals that stop a run: those of terminals and queues, but for SIGHUP where ``nohup`` ignores it."""
    numbers = dict.fromkeys([*_WATCHED, *filter(None, [_warning()])])
    return tuple(each for each in numbers if each != signal.SIGHUP or signal.getsignal(each) != signal.SIG_IGN)


def warning_of_submitit() -> int:
    """Return the signal that submitit warns this process by; 0 if submitit has not started it."""
    return _warning() if "SUBMITIT_EXECUTOR" in os.environ else 0


def _warning() -> int:
    found = getattr(signal, f"SIG{os.environ.get(_OF_SUBMITIT, 'USR2')}", None)
    return found if isinstance(found, signal.Signals) else 0


def _watch(handler: Callable[[int, FrameType | None], None]) -> dict[int, Any]:
    try:
        return {number: signal.signal(number, handler) for number in watched()}
    except ValueError:  # Python allows signal handlers in the main thread only
        return {}


def _restore(handlers: Mapping[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, signal.SIG_DFL if handler is None else handler)  # None: it was not Python's
    if _left.clock is not None:
        _left.clock.cancel()
        _left.clock = None
