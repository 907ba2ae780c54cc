"""The start and the end of the processes that learn together, on this machine or under ``torchrun``."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

import torch
from torch import distributed as dist
from torch.distributed import TCPStore  # type: ignore[attr-defined]  # torch does not say that it exports it

from warp_torchrl.parallel import group
from warp_torchrl.parallel.group import WorkerDied

Work = Callable[[dict[str, Any]], None]
"""What a process does that is not the first; called with the run's configuration."""
FEWEST_WORLDS = 64
"""Worlds that ``auto`` gives a process at least: with fewer a step costs hardly less, and each has some 0.6 GiB."""
_WAIT = timedelta(days=1)  # a process that has ended is noticed at once; others may wait for an evaluation
_SECONDS_TO_END = 10.0
_SECONDS_TO_BREAK = 2.0  # in which a process whose connection has broken off may still be ending
_SECONDS_BETWEEN_LOOKS = 0.05
_HOST = "127.0.0.1"


def is_torchrun() -> bool:
    """Return whether ``torchrun`` has started this process."""
    return "TORCHELASTIC_RUN_ID" in os.environ


def torchrun_rank() -> int:
    """Return the number that ``torchrun`` has given this process; 0 without it."""
    return int(os.environ["RANK"]) if is_torchrun() else 0


def automatic(n_worlds: int, device: torch.device) -> int:
    """Return how many processes ``processes=auto`` takes.

    As many as torch has threads (or, on CUDA, devices), as long as they share the worlds equally and have 64 each.
    ``OMP_NUM_THREADS`` sets the threads.
    """
    if is_torchrun():
        return int(os.environ["WORLD_SIZE"])
    most = torch.cuda.device_count() if device.type == "cuda" else torch.get_num_threads()
    fitting = (each for each in range(most, 1, -1) if n_worlds % each == 0 and n_worlds // each >= FEWEST_WORLDS)
    return next(fitting, 1)


@contextmanager
def processes(count: int, values: Mapping[str, Any], module: str) -> Iterator[None]:
    """Run a block as process 0 of so many; the others do their work beside it, and end with it.

    Args:
        count: Processes in all.
        values: The configuration that the others are told.
        module: What they run: it calls ``follow``.

    Raises:
        WorkerDied: If one of the others ends before the block does.
    """
    if count == 1:
        yield
        return
    threads, others = torch.get_num_threads(), _start(count, module)
    try:
        group.share(dict(values))
        yield
    except WorkerDied as error:
        raise WorkerDied(_ended(others) or str(error)) from error
    finally:
        dist.destroy_process_group()
        torch.set_num_threads(threads)
        _end(others)


def _start(count: int, module: str) -> list[subprocess.Popen[bytes]]:
    """Start the other processes, join the group and share the threads."""
    if is_torchrun():
        dist.init_process_group(_backend(), timeout=_WAIT)
        return []
    store = TCPStore(_HOST, 0, count, is_master=True, wait_for_workers=False)
    threads = max(1, torch.get_num_threads() // count)
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        "PYTHONWARNINGS": "ignore:resource_tracker",  # of what a killed process leaves: the last line is the error's
    }
    others = [
        subprocess.Popen([sys.executable, "-m", module, *map(str, (rank, count, store.port, threads))], env=environment)
        for rank in range(1, count)
    ]
    try:
        _wait_for(others, store)
    except BaseException:
        _end(others, seconds=0.0)
        raise
    torch.set_num_threads(threads)
    dist.init_process_group(_backend(), store=store, rank=0, world_size=count, timeout=_WAIT)
    return others


def _wait_for(others: Sequence[subprocess.Popen[bytes]], store: TCPStore) -> None:
    """Wait until the other processes are there.

    Raises:
        WorkerDied: If one ends before.
    """
    while not store.check([_there(rank) for rank in range(1, len(others) + 1)]):
        if any(each.poll() is not None for each in others):
            raise WorkerDied(_ended(others))
        time.sleep(_SECONDS_BETWEEN_LOOKS)


def _there(rank: int) -> str:
    """Return the key of the store by which a process says that it is there."""
    return f"there/{rank}"


def join(arguments: Sequence[str], work: Work) -> None:
    """Run in a process that ``processes`` has started.

    Args:
        arguments: Its number, that of all processes, the first one's port, and the threads that it may use.
        work: What it does.
    """
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1):  # a terminal sends them to all: the first one decides
        signal.signal(each, signal.SIG_IGN)
    rank, count, port, threads = map(int, arguments)
    torch.set_num_threads(threads)
    try:
        store = TCPStore(_HOST, port, count, is_master=False)
        store.set(_there(rank), "")
        dist.init_process_group(_backend(), store=store, rank=rank, world_size=count, timeout=_WAIT)
    except RuntimeError:  # the first process has ended
        sys.exit(1)
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


def _ended(others: Sequence[subprocess.Popen[bytes]]) -> str:
    """Return one line that names the processes that have ended, and how; empty if none has."""
    codes = {rank: _code_of(each, _SECONDS_TO_BREAK) for rank, each in enumerate(others, start=1)}
    told = [f"process {rank} by {_how(code)}" for rank, code in codes.items() if code]
    return f"a process of the run has ended: {', '.join(told)}" if told else ""


def _how(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _code_of(process: subprocess.Popen[bytes], seconds: float) -> int | None:
    """Return a process's exit code; None if it has not ended in so many seconds."""
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        return None


def _end(others: Sequence[subprocess.Popen[bytes]], seconds: float = _SECONDS_TO_END) -> None:
    for each in others:
        if _code_of(each, seconds) is None:
            each.kill()
            each.wait()
