"""Every process that a command has started ends within seconds when the command is killed, at whatever moment."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.stress.processes import ROOT, TINY

pytestmark = pytest.mark.stress
KILLS = 6
TRAIN = (str(ROOT / "train.py"), *TINY, "total_frames=10000000", "hydra.run.dir=run")
COMMANDS = {
    "processes": (*TRAIN, "processes=2"),
    "collector": (*TRAIN, "collector=process", "collector.workers=2", "collector.steps=20000"),
    "sweep": (*TRAIN[:-1], "-m", "seed=0,1", "hydra/launcher=joblib", "hydra.launcher.n_jobs=3", "hydra.sweep.dir=run"),
    "search": ("-m", "warp_torchrl", "search", *TRAIN[1:-1], "search=ppo", "search.jobs=2", "search.out=run"),
}


def marked(mark):
    """The command lines of the processes that have a text in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark.encode() in path.read_bytes():
                found.append(path.with_name("cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return found


@pytest.mark.parametrize("kind", COMMANDS)
def test_nothing_outlives_a_killed_command(tmp_path, kind, capfd):
    draws, seconds = random.Random(kind), []
    for kill in range(KILLS):
        folder, mark = tmp_path / str(kill), f"WARP_TEST_MARK={kind}-{os.getpid()}-{kill}"
        folder.mkdir()
        process = subprocess.Popen(
            [sys.executable, *COMMANDS[kind]],
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), **dict([mark.split("=")])},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        time.sleep(draws.uniform(1.0, 25.0))
        process.send_signal(signal.SIGKILL)
        process.wait()
        begin = time.monotonic()
        while marked(mark) and time.monotonic() - begin < 30.0:
            time.sleep(0.05)
        assert not marked(mark)
        seconds.append(time.monotonic() - begin)
    with capfd.disabled():
        print(f"\n{kind}: of {KILLS} killed commands the last process was gone after {max(seconds):.1f} s at most")
