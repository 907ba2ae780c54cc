"""When a run saves: every so many frames, and by the clock, which takes a hundredth of the run's time and no more."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

FIRST = 10.0
"""Seconds after which the clock asks for its first save."""
SHARE = 0.01
"""Of the run's time, what saves may take before the clock asks for another."""


def passes(interval: int, frames: int, batch: int) -> bool:
    """Return whether a batch, with which a run came to so many frames, reached a multiple of the interval."""
    return frames // interval > (frames - batch) // interval


class SaveClock:
    """Says when a run should save that has not saved for long.

    The first save is due soon after the start, each later one ``minutes`` after the one before, but none until all
    saves, and one more that takes as long as the last, fit into a hundredth of the time since the start: where a
    replay memory makes saves slow they are rare. It draws no random number.

    Args:
        minutes: Between saves; 0: none is ever due.
        now: Tells the time [s].
    """

    def __init__(self, minutes: float, now: Callable[[], float] = time.monotonic) -> None:
        self._interval, self._now = 60.0 * minutes, now
        self.saves, self._spent, self._took = 0, 0.0, 0.0
        self._start = self._last = now()

    def is_due(self) -> bool:
        """Return whether the run should save now."""
        now = self._now()
        wait = self._interval if self.saves else min(FIRST, self._interval)
        is_cheap = self._spent + self._took <= SHARE * (now - self._start)
        return self._interval > 0.0 and now - self._last >= wait and is_cheap

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Count what is done within it as a save."""
        before = self._now()
        yield
        self._last = self._now()
        self._took = self._last - before
        self._spent += self._took
        self.saves += 1

    def share(self) -> float:
        """Return the share of the time since the start that saves took, 0..1."""
        return self._spent / max(self._now() - self._start, 1e-9)
