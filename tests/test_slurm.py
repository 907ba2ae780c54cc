"""The batch scripts of docs/examples/slurm, under a queue that is this machine."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SCRIPTS = ROOT / "docs" / "examples" / "slurm"
TINY = ("landscape.size=8", "n_worlds=4", "horizon=8", "collector.steps=4", "algorithm.minibatch_size=8")
SHORT = ("evaluation.episodes=2", "picture=null", "evaluation.baselines=[noop]")
SRUN = """#!/bin/bash
echo $$ > steps
for task in 0 1; do SLURM_PROCID=$task SLURM_LOCALID=$task SLURM_NTASKS=2 "$@" & tasks="$tasks $!"; done
trap 'kill -USR1 $tasks' USR1
worst=0
for task in $tasks; do
    while wait $task; status=$?; kill -0 $task 2>/dev/null; do :; done
    [ $status -gt $worst ] && worst=$status
done
exit $worst
"""
"""A queue of two tasks on this machine, which passes the queue's signal on."""
SCONTROL = """#!/bin/bash
[ "$1" = show ] && echo 127.0.0.1 || echo "$@" >> requeued
"""


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """A folder with the project's script, and programs that stand for Slurm's."""
    for name, text in (("srun", SRUN), ("scontrol", SCONTROL)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    shutil.copy(ROOT / "train.py", tmp_path)
    path = os.pathsep.join((str(tmp_path), str(Path(sys.executable).parent), os.environ["PATH"]))
    return tmp_path, {
        **os.environ,
        "PATH": path,
        "PYTHONPATH": str(ROOT),
        "SLURM_JOB_ID": "7",
        "SLURM_JOB_NODELIST": "n",
    }


def start(queue, script, *overrides, **variables):
    folder, environment = queue
    command = ["bash", str(SCRIPTS / script), *TINY, *overrides]
    return subprocess.Popen(command, cwd=folder, env={**environment, **variables}, start_new_session=True)


@pytest.mark.parametrize("name", sorted(path.name for path in SCRIPTS.iterdir()))
def test_a_script_is_one_that_bash_reads_and_says_how_it_is_called(name):
    assert subprocess.run(["bash", "-n", str(SCRIPTS / name)]).returncode == 0
    assert "#   sbatch " in (text := (SCRIPTS / name).read_text()) and f"docs/examples/slurm/{name}" in text


@pytest.mark.slow
def test_one_run_of_two_tasks_ends_with_an_evaluation(queue):
    assert start(queue, "one_run.sbatch", *SHORT[:1], SHORT[2], "total_frames=64").wait(120) == 0
    assert (queue[0] / "runs" / "7" / "evaluation.json").exists() and not (queue[0] / "requeued").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("script", "run"), [("one_run.sbatch", "runs/7"), ("sweep.sbatch", "runs/sweep/qmix-1")])
def test_a_run_that_is_warned_saves_and_is_queued_again(queue, script, run):
    job = start(queue, script, "total_frames=10_000_000", SLURM_ARRAY_TASK_ID="3")
    metrics = queue[0] / run / "metrics.csv"
    deadline = time.monotonic() + 90
    while not (metrics.exists() and len(metrics.read_text().splitlines()) > 2) and time.monotonic() < deadline:
        time.sleep(0.1)
    warned = int((queue[0] / "steps").read_text()) if script == "one_run.sbatch" else job.pid  # B: in the other
    os.kill(warned, signal.SIGUSR1)
    assert job.wait(60) == 138
    assert (queue[0] / "requeued").read_text() == "requeue 7\n" and list((queue[0] / run / "checkpoints").iterdir())
