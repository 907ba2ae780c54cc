"""Timing: medians of repeats, or means, with the contenders in alternation, so that other load slows all of them alike.

On one thread it measures processor time, which other load does not change; else the wall clock.
"""

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch

from warp_torchrl.algorithms import parallel

Timer = Callable[[], float]


def is_alone(device: str) -> bool:
    """Return whether all work happens on one thread of one process."""
    return device == "cpu" and torch.get_num_threads() == 1 and parallel.size() == 1


def clock(device: str) -> Timer:
    """Return a clock [s] that first waits for the device to finish its work."""
    if device == "cpu":
        return time.process_time if is_alone(device) else time.perf_counter

    def after_all_work() -> float:
        torch.cuda.synchronize()
        return time.perf_counter()

    return after_all_work


def take_turns(contenders: Mapping[str, Callable[[], object]], repeats: int, device: str) -> dict[str, list[float]]:
    """Return the time of each of ``repeats`` calls of each contender [s], after one call that does not count."""
    now = clock(device)
    for contender in contenders.values():
        contender()
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, contender in contenders.items():
            start = now()
            contender()
            seconds[name].append(max(now() - start, 1e-9))
    return seconds


def spread(name: str, values: Sequence[float]) -> dict[str, Any]:
    """Return the median of some values under a name, and the lowest and the highest of them."""
    return {name: statistics.median(values), "lowest": min(values), "highest": max(values)}


def mean_rate(name: str, steps: Sequence[int], seconds: Sequence[float]) -> dict[str, Any]:
    """Return the mean rate over some repeats under a name, and those of the slowest and the fastest of them."""
    rates = [step / second for step, second in zip(steps, seconds, strict=True)]
    return {name: sum(steps) / sum(seconds), "lowest": min(rates), "highest": max(rates)}
