"""Parts of many fires: as many at once as memory holds, side by side in threads."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from warp_torchrl.system import memory
from warp_torchrl.world.state.window import Window

_MOST_CELLS = 2**24  # of the windows of fires that burn at once
_BYTES_A_FIRE, _BYTES_A_CELL = 64, 200  # that a cell of a window takes at most, for each fire and for the map
_BYTES_OF_GROUP = 96  # that a cell takes for the planes of each group
T = TypeVar("T")


class TooMany(Exception):  # noqa: N818
    """Too many fires to burn at once in their window."""


class Ended(Exception):  # noqa: N818
    """Other threads have ended the work."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Division:
    """Division of many fires into parts that burn at once.

    Attributes:
        each: Fires of each law where there are several, which parts do not divide as long as it fits; None: one law.
        swift: What fires of one part have alike, float32 [B], see ``Fires.swift``; None: nothing.
    """

    each: int | None = None
    swift: Tensor | None = None

    def parts(self, whole: slice, size: int) -> Iterator[slice]:
        """Yield parts of at most ``size`` fires: of whole laws where some fit, else of one law each."""
        if self.swift is not None:
            return (less for like in _alike(self.swift, whole) for less in _parts(like, size))
        if self.each is None:
            return _parts(whole, size)
        if size >= self.each:
            return _parts(whole, size - size % self.each)
        return (less for law in _parts(whole, self.each) for less in _parts(law, size))

    def each_part(
        self, burn: Callable[[slice], T], fires: int, at_once: int, workers: int, ended: threading.Event
    ) -> Iterator[T]:
        """Yield what is returned of each part, in order; parts that are too many are halved.

        Args:
            burn: Burns a part, or raises ``TooMany``; it is called in worker threads.
            fires: How many there are.
            at_once: How many burn at once at most.
            workers: Threads.
            ended: Set when the work ends early.
        """
        limit = [at_once]

        def burned(part: slice) -> list[T]:
            count = part.stop - part.start
            try:
                if count > limit[0]:
                    raise TooMany
                return [burn(part)]
            except TooMany:
                half = limit[0] = min(limit[0], -(-count // 2))
                return [each for less in self.parts(part, half) for each in burned(less)]

        for found in _side_by_side(burned, self.parts(slice(0, fires), at_once), workers, ended):
            yield from found


def check_memory(window: Window, fires: int, groups: int, workers: int) -> None:
    """Refuse a window that is too large for ``fires`` fires at once.

    Args:
        window: That all of them share.
        fires: How many.
        groups: Of fires that differ in law or weather.
        workers: Threads that each have such a window.

    Raises:
        TooMany: If fewer fires may fit.
        ValueError: If not even one fits.
    """
    of_groups = 0 if groups == 1 else groups * _BYTES_OF_GROUP
    wanted = window.cells * (fires * _BYTES_A_FIRE + of_groups + _BYTES_A_CELL)
    there = memory.available()
    if fires > 1 and (fires * window.cells > _MOST_CELLS or wanted * workers > there):
        raise TooMany
    if wanted > there:
        raise memory.too_little(f"a fire in a window of {window.height} x {window.width} cells", wanted, there)


def _parts(whole: slice, size: int) -> Iterator[slice]:
    """Yield ``size`` fires at a time."""
    begins = range(whole.start, whole.stop, size)
    yield from (slice(begin, min(begin + size, whole.stop)) for begin in begins)


def _alike(swift: Tensor, whole: slice) -> Iterator[slice]:
    """Yield the runs of fires that take the same ticks."""
    begin = whole.start
    for count in swift[whole].unique_consecutive(return_counts=True)[1].tolist():
        yield slice(begin, begin + count)
        begin += count


def _side_by_side(
    function: Callable[[slice], T],
    parts: Iterable[slice],
    workers: int,
    ended: threading.Event,
) -> Iterator[T]:
    """Yield a function of each part, in order, computed by ``workers`` threads; an event ends it early.

    Few operations of a fire are large enough for torch's own threads, so each fire takes one thread.
    """
    if workers == 1:
        yield from map(function, parts)
        return
    waiting: deque[Future[T]] = deque()
    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        try:
            for part in parts:
                waiting.append(pool.submit(function, part))
                if len(waiting) > workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            ended.set()  # after an error, an interruption, or who asked has had enough
            pool.shutdown(wait=False, cancel_futures=True)
