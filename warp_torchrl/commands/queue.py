"""Preemption of a job by a queue: the warning signal of submitit, and the job's next start.

submitit raises an exception wherever the job is at that moment, and torch may raise another one from it.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from warp_torchrl.system.signals import Stopped, warning_of_submitit

Handler = Callable[[int, FrameType | None], object]


class Ended(Stopped):
    """The queue has ended a job outside of its training, and does not start it again."""

    def __init__(self, number: int) -> None:
        name = signal.Signals(number).name
        Exception.__init__(self, f"stopped by signal {name}; go on with the same command line")
        self.number = number


class Queue:
    """Effect of a queue's warning on a job.

    Args:
        number: Of the signal that it warns by; 0 where no queue has started the job.
        handler: What submitit does at it.
    """

    def __init__(self, number: int = 0, handler: Handler = signal.default_int_handler) -> None:
        self.number, self._handler = number, handler
        self._has_refused = False

    def warn(self, number: int, frame: FrameType | None = None) -> None:
        """Do what submitit does, and end the process where that would."""
        try:
            self._handler(number, frame)
        except SystemExit as end:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code & 255 if isinstance(end.code, int) else 1)
        except Exception:
            self._has_refused = True
            raise

    def start_again(self, error: Exception) -> None:
        """Let the queue start the job again, which ends the process, if its warning has stopped a run that has saved.

        Return otherwise, also where submitit has started it too often.
        """
        if isinstance(error, Stopped) and error.number == self.number:
            with suppress(Exception):  # told in the job's log
                self.warn(self.number)

    def explain(self, error: Exception) -> Exception:
        """Return what has ended a job: the warning, where an error comes from that."""
        return Ended(self.number) if self._has_refused else error


@contextmanager
def queued() -> Iterator[Queue]:
    """Watch for a queue's warning while a job is done."""
    number = warning_of_submitit()
    handler = signal.getsignal(number) if number else None
    if not callable(handler):
        yield Queue()
        return
    queue = Queue(number, handler)
    signal.signal(number, queue.warn)
    try:
        yield queue
    finally:
        signal.signal(number, handler)
