"""Times of checkpoints: at intervals of frames, and at intervals of time that cost at most 1 % of the run."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

MOST_TIME_SHARE = 0.01
"""Largest share of the run's time that saves by the clock may take."""


def passes(interval: int, frames: int, batch: int) -> bool:
    """Return whether the last batch, which ended at ``frames``, passed a multiple of the interval."""
    return frames // interval > (frames - batch) // interval


class SaveClock:
    """Decides by the clock when a run saves.

    The first save is due at once, each later one ``minutes`` after the last. A save waits while all saves, with the
    expected time of the next one, would take more than 1 % of the time since the start; so slow saves, of a large
    replay memory, are rare.

    Args:
        minutes: Minutes between saves; 0 disables them.
        size: Returns the size of a save [bytes].
        now: Returns the time [s].
    """

    def __init__(self, minutes: float, size: Callable[[], int], now: Callable[[], float] = time.monotonic) -> None:
        self._interval, self._size, self._now = 60.0 * minutes, size, now
        self.saves, self._spent, self._pace = 0, 0.0, 0.0
        self._start = self._last = now()

    def is_due(self) -> bool:
        """Return whether the run should save now."""
        if not self._interval or (self.saves and self._now() - self._last < self._interval):
            return False
        return self._spent + self._pace * self._size() <= MOST_TIME_SHARE * (self._now() - self._start)

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Time the body as a save."""
        before = self._now()
        yield
        self._last = self._now()
        self._pace = (self._last - before) / max(self._size(), 1)
        self._spent += self._last - before
        self.saves += 1

    def share(self) -> float:
        """Return the share of the run's time that saves took, 0..1."""
        return self._spent / max(self._now() - self._start, 1e-9)
