"""When a run saves: every so many frames, and by the clock, which takes a hundredth of the run's time and no more."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

SHARE = 0.01
"""Of the run's time, what saves may take before the clock asks for another."""


def passes(interval: int, frames: int, batch: int) -> bool:
    """Return whether a batch, with which a run came to so many frames, reached a multiple of the interval."""
    return frames // interval > (frames - batch) // interval


class SaveClock:
    """Says when a run should save that has not saved for long.

    The first save is due at once, each later one ``minutes`` after the one before, but none until all saves, and one
    more at the pace of the last, fit into a hundredth of the time since the start: where a replay memory makes saves
    slow they are rare. It draws no random number.

    Args:
        minutes: Between saves; 0: none is ever due.
        size: Tells what a save would write [bytes].
        now: Tells the time [s].
    """

    def __init__(self, minutes: float, size: Callable[[], int], now: Callable[[], float] = time.monotonic) -> None:
        self._interval, self._size, self._now = 60.0 * minutes, size, now
        self.saves, self._spent, self._pace = 0, 0.0, 0.0
        self._start = self._last = now()

    def is_due(self) -> bool:
        """Return whether the run should save now."""
        if not self._interval or (self.saves and self._now() - self._last < self._interval):
            return False
        return self._spent + self._pace * self._size() <= SHARE * (self._now() - self._start)

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Count what is done within it as a save."""
        before = self._now()
        yield
        self._last = self._now()
        self._pace = (self._last - before) / max(self._size(), 1)
        self._spent += self._last - before
        self.saves += 1

    def share(self) -> float:
        """Return the share of the time since the start that saves took, 0..1."""
        return self._spent / max(self._now() - self._start, 1e-9)
