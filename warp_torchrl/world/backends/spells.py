"""Lazily computed rates of spread, by spell of weather and window of the map.

A value is the same to the bit in every window that has it, and in strips of the map.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import torch
from torch import Tensor

from warp_torchrl.world.state.window import COLUMNS, Window

_STRIP = 2**16  # cells of a strip, at least: their planes lie in a cache
_KEPT = 2**24  # numbers of planes that are kept, 64 MiB


class PlanesOfSpells:
    """The latest planes, up to a number of cells together.

    Args:
        make: Makes the planes of a key.
    """

    def __init__(self, make: Callable[[int, Window], Tensor]) -> None:
        self._make = make
        self._kept: OrderedDict[tuple[int, Window], Tensor] = OrderedDict()
        self._lock = threading.Lock()

    def __call__(self, number: int, window: Window) -> Tensor:
        """Return the planes of a number in a window, made once where fires ask one after the other."""
        with self._lock:
            found = self._kept.pop((number, window), None)
            self._kept[number, window] = found = self._make(number, window) if found is None else found
            while len(self._kept) > 1 and sum(each.numel() for each in self._kept.values()) > _KEPT:
                self._kept.popitem(last=False)
            return found


class Highest:
    """The highest of many numbers, of which so many are kept.

    Args:
        count: How many.
    """

    def __init__(self, count: int) -> None:
        self._count, self._least, self._kept = count, -math.inf, torch.zeros(0)

    def add(self, values: Tensor) -> None:
        """Take numbers, float32 [n], of which none is NaN."""
        kept = torch.cat((self._kept.to(values.device), values[values > self._least]))
        if len(kept) > self._count:
            kept = kept.topk(self._count, sorted=False).values
            self._least = float(kept.min())
        self._kept = kept

    @property
    def least(self) -> float:
        """Return the least of them."""
        return float(self._kept.min())


def strips(size: tuple[int, int]) -> Iterator[Window]:
    """Yield windows of whole rows of a map, from north to south; in none but the last one lies an unfilled vector."""
    rows = math.ceil(_STRIP / size[1] / COLUMNS) * COLUMNS
    for top in range(0, size[0], rows):
        yield Window(top, 0, min(rows, size[0] - top), size[1], size)


def last_strip(size: tuple[int, int]) -> Window:
    """Return some last rows of a map, whose last part that fills no vector is that of the whole map."""
    rows = min(size[0], size[0] % COLUMNS or COLUMNS)
    return Window(size[0] - rows, 0, rows, size[1], size)


def in_window(spread: Callable[[Window], Tensor], window: Window) -> Tensor:
    """Return planes of a window, [P, h, w], as they are on the whole map.

    Args:
        spread: Returns planes of whole rows, or of columns that fill vectors.
        window: The window.
    """
    found = spread(window)
    bottom, right = window.top + window.height == window.map[0], window.left + window.width >= window.map[1]
    if not window.is_whole and bottom and right and window.map[0] * window.map[1] % COLUMNS:
        last = last_strip(window.map)
        rows, columns = min(last.height, window.height), window.on_map.width
        found[:, window.height - rows :, :columns] = spread(last)[:, last.height - rows :, window.left :]
    return found


def on_strips(
    plane: Callable[[Window], Tensor], size: tuple[int, int], workers: int
) -> Iterator[tuple[Window, Tensor]]:
    """Yield a plane of a whole map strip by strip, with each strip.

    Args:
        plane: Returns it in a window, [h, w].
        size: (H, W) of the map.
        workers: Threads.
    """
    each = list(strips(size))
    if workers == 1 or len(each) == 1:
        yield from ((strip, plane(strip)) for strip in each)
        return
    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        yield from zip(each, pool.map(plane, each), strict=True)
