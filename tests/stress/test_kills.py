"""A run killed at random moments, and resumed each time, ends with the weights of a run that no one touched.

Savers of recordings that are killed, several at once in one folder, leave what they have said and nothing half.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
import torch

from tests.stress.processes import ROOT, TINY, finish, rows, start, wait_for
from tests.stress.saves import KINDS, left
from warp_torchrl.demonstrations.files import find_recordings, read_recording
from warp_torchrl.runs.checkpoint import CheckpointError, newest

pytestmark = pytest.mark.stress
KILLS = 10
ITERATIONS = 400


SAVER = """
import sys
from pathlib import Path
from tests.stress.saves import KINDS
number = int(sys.argv[1])
while True:
    KINDS["recording"].save(Path("people"), number)
    print(number, flush=True)
"""


def said(path):
    return path.read_text().split()


def test_killed_savers_leave_what_they_said_and_nothing_half(tmp_path):
    draws, told = random.Random(8), [tmp_path / f"told{number}" for number in (1, 2, 3)]
    processes = []
    for number, path in enumerate(told, start=1):
        with path.open("w") as out:
            given = [sys.executable, "-c", SAVER, str(number)]
            processes.append(
                subprocess.Popen(given, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=out)
            )
    wait_for(lambda: all(len(said(path)) > 3 for path in told), processes[0])
    for process in processes:
        time.sleep(draws.uniform(0.0, 0.5))
        process.kill()
        process.wait()
    people = tmp_path / "people"
    seeds = [read_recording(folder).seed for folder in find_recordings(people)]
    for number, path in enumerate(told, start=1):
        assert 0 <= seeds.count(number) - len(said(path)) <= 1  # it may have been killed before it could say so
    KINDS["recording"].save(people, 4)
    assert not left(people)
    print(f"\nsavers killed: 3, said and there: {[len(said(path)) for path in told]}, broken: 0")


def grown(run, before):
    return rows(run) > before


@pytest.mark.parametrize("algorithm", ["mappo", "dqn"])
def test_random_kills_change_nothing(tmp_path, algorithm):
    overrides = [*TINY, f"algorithm={algorithm}", f"total_frames={32 * ITERATIONS}", "checkpoint.interval=32"]
    if algorithm == "dqn":
        overrides += ["algorithm.capacity=500", "algorithm.warm_up=64", "algorithm.updates=2"]
    finish(tmp_path, *overrides, "hydra.run.dir=whole")
    draws, run, survived, at = random.Random(8), tmp_path / "cut", 0, []
    for _ in range(KILLS):
        has_checkpoint = (run / "checkpoints").is_dir() and any(
            each.name.isdigit() for each in (run / "checkpoints").iterdir()
        )
        process = start(tmp_path, *(["resume=cut"] if has_checkpoint else [*overrides, "hydra.run.dir=cut"]))
        wait_for(partial(grown, run, rows(run)), process)
        time.sleep(draws.uniform(0.0, 1.0))
        process.send_signal(signal.SIGKILL)
        process.wait()
        try:
            found, skipped = newest(run)
            assert not skipped
            at.append(found.manifest.frames // 32)
            survived += 1
        except CheckpointError as error:
            assert "no folder in" in str(error)
            shutil.rmtree(run / "checkpoints", ignore_errors=True)
            at.append(0)
            survived += 1
    finish(tmp_path, "resume=cut")
    ours, theirs = (newest(tmp_path / name)[0] for name in ("cut", "whole"))
    assert ours.manifest.frames == theirs.manifest.frames == 32 * ITERATIONS
    for name, value in theirs.training()["loss"].items():
        assert torch.equal(ours.training()["loss"][name], value), name
    assert rows(run) == ITERATIONS
    print(
        f"\n{algorithm}: kills survived / tried: {survived} / {KILLS}, final weights equal; "
        f"last checkpoints at iterations {at} of {ITERATIONS}"
    )
