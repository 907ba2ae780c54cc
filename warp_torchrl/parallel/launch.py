"""The start and the end of the processes that learn together, on this machine or under ``torchrun``."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from multiprocessing.context import SpawnProcess
from typing import Any

import torch
from torch import distributed as dist

from warp_torchrl.parallel import group
from warp_torchrl.parallel.group import WorkerDied

Work = Callable[[dict[str, Any]], None]
"""What processes other than the first do; called with the run's configuration. A function of a module."""
FEWEST_WORLDS = 32
"""Worlds that ``auto`` gives a process at least: with fewer, a step's operations cost the same as with these."""
_WAIT = timedelta(days=1)  # a process that has ended is noticed at once; others may wait for an evaluation
_SECONDS_TO_END = 10.0
_HOST = "127.0.0.1"


def is_torchrun() -> bool:
    """Return whether ``torchrun`` has started this process."""
    return "TORCHELASTIC_RUN_ID" in os.environ


def torchrun_rank() -> int:
    """Return the number that ``torchrun`` has given this process; 0 without it."""
    return int(os.environ["RANK"]) if is_torchrun() else 0


def automatic(n_worlds: int, device: torch.device) -> int:
    """Return how many processes ``processes=auto`` takes.

    As many as torch has threads (or, on CUDA, devices), as long as they share the worlds equally and have 32 each.
    ``OMP_NUM_THREADS`` sets the threads.
    """
    if is_torchrun():
        return int(os.environ["WORLD_SIZE"])
    most = torch.cuda.device_count() if device.type == "cuda" else torch.get_num_threads()
    fitting = (each for each in range(most, 1, -1) if n_worlds % each == 0 and n_worlds // each >= FEWEST_WORLDS)
    return next(fitting, 1)


@contextmanager
def processes(count: int, values: Mapping[str, Any], work: Work) -> Iterator[None]:
    """Run a block as process 0 of so many; the others do their work beside it, and end with it.

    Args:
        count: Processes in all.
        values: The configuration that the others are told.
        work: What they do.

    Raises:
        WorkerDied: If one of the others ends before the block does.
    """
    if count == 1:
        yield
        return
    threads, others = torch.get_num_threads(), _start(count, work)
    try:
        group.share(dict(values))
        yield
    except WorkerDied as error:
        raise WorkerDied(_ended(others) or str(error)) from error
    finally:
        dist.destroy_process_group()
        torch.set_num_threads(threads)
        _end(others)


def _start(count: int, work: Work) -> list[SpawnProcess]:
    """Start the other processes, join the group and share the threads."""
    if is_torchrun():
        dist.init_process_group(_backend(), timeout=_WAIT)
        return []
    store = dist.TCPStore(_HOST, 0, count, is_master=True, wait_for_workers=False)
    threads = max(1, torch.get_num_threads() // count)
    context = multiprocessing.get_context("spawn")
    others = [
        context.Process(target=_other, args=(rank, count, store.port, threads, work), daemon=True)
        for rank in range(1, count)
    ]
    for each in others:
        each.start()
    torch.set_num_threads(threads)
    dist.init_process_group(_backend(), store=store, rank=0, world_size=count, timeout=_WAIT)
    return others


def _other(rank: int, count: int, port: int, threads: int, work: Work) -> None:
    """Run in a process that ``_start`` has started."""
    torch.set_num_threads(threads)
    store = dist.TCPStore(_HOST, port, count, is_master=False)
    dist.init_process_group(_backend(), store=store, rank=rank, world_size=count, timeout=_WAIT)
    _follow(work)


def follow(work: Work) -> None:
    """Run in a process that ``torchrun`` has started, and which is not the first."""
    dist.init_process_group(_backend(), timeout=_WAIT)
    _follow(work)


def _follow(work: Work) -> None:
    try:
        work(group.share(None))
        dist.destroy_process_group()
    except WorkerDied:  # the first process has ended, and has told why
        sys.exit(1)


def _backend() -> str:
    """Return what the processes talk by: Gloo between CPUs, NCCL between GPUs."""
    return "cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "gloo"


def _ended(others: list[SpawnProcess]) -> str:
    """Return one line that names the processes that have ended, and how; empty if none has."""
    for each in others:
        each.join(1.0)  # what has broken off may still be ending
    codes = {rank: each.exitcode for rank, each in enumerate(others, start=1) if each.exitcode}
    told = (f"process {rank} by {'signal ' if code < 0 else 'exit code '}{abs(code)}" for rank, code in codes.items())
    return f"a process of the run has ended: {', '.join(told)}" if codes else ""


def _end(others: list[SpawnProcess]) -> None:
    for each in others:
        each.join(_SECONDS_TO_END)
        if each.is_alive():
            each.kill()
            each.join()
