"""Tiny trainings in processes of their own, to be signalled, killed and watched."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
TINY = (
    "landscape.size=12",
    "horizon=16",
    "n_worlds=4",
    "collector.steps=8",
    "collector.grows_at=0",
    "evaluation.episodes=4",
    "checkpoint.minutes=0",
    "evaluation.mode=sampled",
    "algorithm.minibatch_size=16",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
)


def start(folder: Path, *arguments: str, program: str = "train.py") -> subprocess.Popen:
    """Start a program in a folder, in a session of its own; its errors go to the file ``stderr`` there."""
    with (folder / "stderr").open("w") as errors:
        return subprocess.Popen(
            [sys.executable, str(ROOT / program), *arguments],
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )


def finish(folder: Path, *arguments: str) -> None:
    """Run a training to its end."""
    process = start(folder, *arguments)
    assert process.wait(timeout=900) == 0, (folder / "stderr").read_text()


def wait_for(what, process: subprocess.Popen, seconds: float = 180.0) -> None:
    """Wait until something is so, or the process ends."""
    deadline = time.monotonic() + seconds
    while not what() and process.poll() is None:
        assert time.monotonic() < deadline, "nothing happens"
        time.sleep(0.005)


def alive(session: int) -> list[str]:
    """Return the command lines of a session's processes."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(path.with_name("cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return found


def rows(run: Path) -> int:
    """Return how many rows ``metrics.csv`` has."""
    path = run / "metrics.csv"
    return max(len(path.read_text(errors="replace").splitlines()) - 1, 0) if path.exists() else 0


def catches(process: subprocess.Popen, number: int) -> bool:
    """Return whether a process has a handler of a signal: of SIGTERM Python has none, and our commands have one."""
    caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text())
    return bool(int(caught[1], 16) >> (number - 1) & 1)
