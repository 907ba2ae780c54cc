"""Speed of training by several processes: at the same worlds in all, and at the same worlds of each process."""

import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import torch

from warp_torchrl.algorithms import parallel
from warp_torchrl.benchmark.tables import entry, spread_of, table
from warp_torchrl.benchmark.timing import spread
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.following import FOLLOWING
from warp_torchrl.training.loop import Training

_BATCHES = 3  # of a turn, after one that does not count


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _one_thread_each(count: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)  # which the processes share
    try:
        yield
    finally:
        torch.set_num_threads(before)


class _Batch(NamedTuple):
    """A batch's frames, its time by the wall clock, and the processor time of the first process [s]."""

    frames: int
    wall: float
    work: float


def _batches(values: Mapping[str, Any]) -> list[_Batch]:
    """Return what some batches of a training took."""
    built = run_config(values)
    with ExitStack() as stack:
        stack.enter_context(_one_thread_each(built.n_processes()))
        stack.enter_context(parallel.processes(built.n_processes(), values, FOLLOWING))
        training = Training(built, SavedConfig(), Path(stack.enter_context(tempfile.TemporaryDirectory())))
        stack.callback(training.close)
        training.join()
        batches, laps = training.batches(), []
        for _ in range(_BATCHES + 1):
            training._learn(next(batches))
            training.go_on()
            laps.append((time.perf_counter(), time.process_time()))
        frames = training.frames_per_batch
        return [_Batch(frames, end[0] - begin[0], end[1] - begin[1]) for begin, end in pairwise(laps)]


def process_scaling(overrides: Sequence[str], worlds: int, most: int, turns: int) -> list[dict[str, Any]]:
    """Measure frames a second of training by 1, 2, 4 ... processes of a thread each, in turns, by the wall clock.

    Args:
        overrides: Of ``train.py``, in the command line's grammar.
        worlds: In all, and of each process.
        most: Largest number of processes.
        turns: Times that all of them are measured, one after the other.

    Returns:
        A row for each number of processes and of worlds: ``frames_per_second``; ``efficiency``, that beside as many
        times the speed of one process; ``work``, the processor time of the first process for a frame of its share,
        beside that of one process alone.
    """
    counts = [2**power for power in range(most.bit_length()) if 2**power <= most]
    cases = [(count, total) for count in counts for total in dict.fromkeys((worlds, count * worlds))]
    found: dict[tuple[int, int], list[_Batch]] = {case: [] for case in cases}
    for _ in range(turns):
        for count, total in cases:
            given = [*overrides, f"n_worlds={total}", f"processes={count}", "collector.grows_at=0"]
            found[count, total] += _batches(plain(compose_config("train", given)))
    rows = []
    for (count, total), batches in found.items():
        speeds = [each.frames / each.wall for each in batches]
        work = statistics.median(each.work * count / each.frames for each in batches)
        kind = "" if count == 1 else "strong" if total == worlds else "weak"
        row: dict[str, Any] = {"scaling": kind, "processes": count, "worlds": total, "work": work}
        rows.append(row | spread("frames_per_second", speeds))
    alone, own = rows[0]["frames_per_second"], rows[0]["work"]
    return [
        row | {"efficiency": row["frames_per_second"] / (row["processes"] * alone), "work": row["work"] / own}
        for row in rows
    ]


def process_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the rows as a table."""
    columns = [entry("scaling"), entry("processes"), entry("worlds"), entry("frames/s", "frames_per_second", "{:,.0f}")]
    shares = [entry("efficiency", pattern="{:.2f}"), entry("work", pattern="{:.2f}")]
    return table([*columns, spread_of("{:,.0f}"), *shares], rows)
