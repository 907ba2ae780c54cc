"""Start and end of the processes that learn together, on this machine or under ``torchrun``."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import torch

from warp_torchrl.algorithms.parallel import group
from warp_torchrl.algorithms.parallel.group import WorkerDied
from warp_torchrl.algorithms.parallel.sockets import Sockets, inherited, pairs
from warp_torchrl.algorithms.parallel.torchrun import Torchrun, is_torchrun
from warp_torchrl.system.parent import command, environment

Work = Callable[[dict[str, Any]], None]
"""What a process does that is not the first; called with the run's configuration."""
FEWEST_WORLDS = 64
"""Worlds that ``auto`` gives a process at least: with fewer a step costs hardly less, and each has some 0.6 GiB."""
_SECONDS_TO_END = 10.0
_SECONDS_TO_BREAK = 2.0  # in which a process whose connection has broken off may still be ending


def automatic(n_worlds: int, device: torch.device) -> int:
    """Return the number of processes of ``processes=auto``.

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
    """Run a block as process 0 of ``count``; the others work beside it, and end with it.

    Args:
        count: Processes in all.
        values: The configuration, which is sent to the others.
        module: Module that they run: it calls ``follow`` of this module.

    Raises:
        WorkerDied: If one of the others ends before the block does.
    """
    if count == 1:
        yield
        return
    threads, seconds = torch.get_num_threads(), 0.0
    others = _start(count, module)
    try:
        group.gather(None)  # they are there
        seconds = _SECONDS_TO_END
        group.share(dict(values))
        yield
    except WorkerDied as error:
        raise WorkerDied(_ended(others) or str(error)) from error
    finally:
        group.leave()
        torch.set_num_threads(threads)
        _end(others, seconds)


def _start(count: int, module: str) -> list[subprocess.Popen[bytes]]:
    """Start the other processes, each with its share of the threads, and enter the group."""
    if is_torchrun():
        group.enter(Torchrun())
        return []
    threads = max(1, torch.get_num_threads() // count)
    own, given = pairs(count - 1)
    others = [_other(module, rank, count, threads, end.fileno()) for rank, end in enumerate(given, start=1)]
    for end in given:
        end.close()
    torch.set_num_threads(threads)
    group.enter(Sockets(0, count, own))
    return others


def _other(module: str, rank: int, count: int, threads: int, end: int) -> subprocess.Popen[bytes]:
    """Start another process, which inherits its end of a pair of sockets."""
    return subprocess.Popen(
        command(module, [str(each) for each in (rank, count, threads, end)]),
        env=environment() | {"PYTHONWARNINGS": "ignore:resource_tracker"},  # the last line is the error's
        pass_fds=(end,),
    )


def join(arguments: Sequence[str], work: Work) -> None:
    """Run in a process that ``processes`` has started.

    Args:
        arguments: Its number, that of all processes, the threads that it may use, and its end of a pair of sockets.
        work: What it does.
    """
    rank, count, threads, end = map(int, arguments)
    torch.set_num_threads(threads)
    group.enter(Sockets(rank, count, [inherited(end)]))
    _follow(work)


def follow(work: Work) -> None:
    """Run in a process that ``torchrun`` has started, and which is not the first."""
    group.enter(Torchrun())
    _follow(work)


def _follow(work: Work) -> None:
    try:
        group.gather(None)  # it is there
        work(group.share(None))
        group.leave()
    except WorkerDied:  # the first process has ended, and has told why
        sys.exit(1)


def _ended(others: Sequence[subprocess.Popen[bytes]]) -> str:
    """Return one line that names the processes that have ended, and how; empty if none has."""
    codes = {rank: _code_of(each, _SECONDS_TO_BREAK) for rank, each in enumerate(others, start=1)}
    told = [f"process {rank} by {_how(code)}" for rank, code in codes.items() if code]
    return f"a process of the run has ended: {', '.join(told)}" if told else ""


def _how(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _code_of(process: subprocess.Popen[bytes], seconds: float) -> int | None:
    """Return a process's exit code; None if it does not end within ``seconds``."""
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        return None


def _end(others: Sequence[subprocess.Popen[bytes]], seconds: float) -> None:
    for each in others:
        if _code_of(each, seconds) is None:
            each.kill()
            each.wait()
