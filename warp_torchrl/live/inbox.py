"""Queue of people's actions: a few of each person, carried out in turn."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator

MOST_ACTS = 16
"""Of one person that wait; a page that is this far behind does no more of theirs."""
Act = Callable[[], None]


class Inbox:
    """Acts of people, from any thread. One person's are done in their order; between persons they take turns."""

    def __init__(self) -> None:
        self._waiting: dict[int, deque[Act]] = {}
        self._changed = threading.Condition()
        self._is_open = True

    def put(self, person: int, act: Act) -> bool:
        """Let an act wait, and return whether it does: it is left out where ``MOST_ACTS`` of the person's wait."""
        with self._changed:
            acts = self._waiting.setdefault(person, deque())
            if len(acts) >= MOST_ACTS:
                return False
            acts.append(act)
            self._changed.notify()
        return True

    def put_alone(self, person: int, act: Act) -> None:
        """Let an act wait, and drop all other waiting acts of the person."""
        with self._changed:
            self._waiting[person] = deque([act])
            self._changed.notify()

    def until(self, end: float) -> Iterator[Act]:
        """Yield acts until a time of ``time.monotonic``; after it, one act of each person that waits."""
        with self._changed:
            turns = len(self._waiting)
        while (act := self._next(end if turns <= 0 else max(end, time.monotonic()))) is not None:
            turns -= 1
            yield act
            if turns <= 0 and time.monotonic() >= end:
                return

    def close(self) -> None:
        """Let ``until`` return."""
        with self._changed:
            self._is_open = False
            self._changed.notify_all()

    def _next(self, end: float) -> Act | None:
        with self._changed:
            while self._is_open and not self._waiting:
                left = end - time.monotonic()
                if left <= 0:
                    return None
                self._changed.wait(left)
            if not self._is_open:
                return None
            person, acts = next(iter(self._waiting.items()))
            del self._waiting[person]
            act = acts.popleft()
            if acts:
                self._waiting[person] = acts  # behind the others
            return act
