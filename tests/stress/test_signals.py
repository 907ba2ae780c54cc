"""Signals to real processes: exit codes, seconds to the exit, nothing left behind."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from tests.stress.processes import ROOT, TINY, alive, catches, finish, rows, start, wait_for
from warp_torchrl.runs.checkpoint import newest

pytestmark = pytest.mark.stress
LONG = [*TINY, "total_frames=1000000", "checkpoint.interval=64", "hydra.run.dir=run"]
COLLECTORS = {"direct": [], "process": ["collector=process", "collector.workers=2"]}


def ended(process, folder, number):
    """Return the seconds from now to the process's end, which must be as the contract says."""
    start = time.perf_counter()
    code = process.wait(timeout=120)
    seconds = time.perf_counter() - start
    *_, last = (folder / "stderr").read_text().strip().splitlines()
    assert code == 128 + number and f"stopped by signal {number.name}" in last, last
    wait_until_alone(process.pid)
    return seconds


def wait_until_alone(session):
    deadline = time.monotonic() + 30
    while alive(session) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not alive(session), "orphans"


@pytest.mark.parametrize("collector", COLLECTORS)
@pytest.mark.parametrize(
    "number",
    [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2],
    ids=lambda each: each.name,
)
def test_a_signal_in_training(tmp_path, number, collector, capfd):
    process = start(tmp_path, *LONG, *COLLECTORS[collector])
    wait_for(lambda: rows(tmp_path / "run") > 5, process)
    process.send_signal(number)
    seconds = ended(process, tmp_path, number)
    assert newest(tmp_path / "run")[0].manifest.frames == 32 * rows(tmp_path / "run")
    with capfd.disabled():
        print(f"\n{number.name} in training, {collector}: {seconds:.2f} s to the exit")


@pytest.mark.parametrize("collector", COLLECTORS)
def test_a_second_signal_exits_at_once(tmp_path, collector, capfd):
    process = start(tmp_path, *LONG, *COLLECTORS[collector], "collector.steps=10000")  # takes minutes
    wait_for(lambda: (tmp_path / "run" / "config.yaml").exists(), process)
    time.sleep(8.0)
    process.send_signal(signal.SIGTERM)
    time.sleep(0.5)
    assert process.poll() is None, "the first is obeyed after the batch"
    process.send_signal(signal.SIGTERM)
    seconds = ended(process, tmp_path, signal.SIGTERM)
    with capfd.disabled():
        print(f"\na second SIGTERM, {collector}: {seconds:.2f} s to the exit")
    assert seconds < 30.0  # TorchRL gives workers in mid-batch ten seconds


def test_a_signal_in_evaluation(tmp_path, capfd):
    finish(tmp_path, *LONG, "total_frames=64")
    process = start(tmp_path, "checkpoint=run", "evaluation.episodes=2000", "hydra.run.dir=seen", program="evaluate.py")
    wait_for(lambda: (tmp_path / "seen").exists(), process)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    seconds = ended(process, tmp_path, signal.SIGINT)
    with capfd.disabled():
        print(f"\nSIGINT in evaluation: {seconds:.2f} s to the exit")


def test_a_killed_run_leaves_no_workers_and_lets_go_of_its_folder(tmp_path, capfd):
    process = start(tmp_path, *LONG, *COLLECTORS["process"])
    wait_for(lambda: rows(tmp_path / "run") > 2, process)
    assert len(alive(process.pid)) > 2
    process.kill()
    process.wait()
    begin = time.perf_counter()
    wait_until_alone(process.pid)
    with capfd.disabled():
        print(f"\nSIGKILL: the last worker is gone after {time.perf_counter() - begin:.2f} s")
    again = start(tmp_path, "resume=run")
    wait_for(lambda: "resumed" in (tmp_path / "run" / "train.log").read_text(), again)
    again.send_signal(signal.SIGTERM)
    ended(again, tmp_path, signal.SIGTERM)


COMMANDS = {
    "evaluate": ["evaluate.py", "policy=local", "scenario=skirmish", "evaluation.episodes=4000", "hydra.run.dir=seen"],
    "correct": ["-m", "warp_torchrl", "correct", "policy=skirmish", "out=people", "episodes=1000"],
    "live": ["-m", "warp_torchrl", "live", "policy=local", "scenario=skirmish", "port=0"],
    "search": ["-m", "warp_torchrl", "search", "search=ppo", "scenario=skirmish", "search.out=found"],
    "benchmark": ["-m", "warp_torchrl", "benchmark", "env", "--repeats", "99"],
    "drawings": ["docs/drawings", "--out", "figures"],
    "processes": ["train.py", *LONG, "processes=2"],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_signal_at_any_moment_of_any_command_is_one_line(tmp_path, name):
    draws = random.Random(name)
    for number in (signal.SIGINT, signal.SIGTERM) * 2:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        first, *given = COMMANDS[name]
        program = [first, given.pop(0)] if first == "-m" else [str(ROOT / first)]
        with (folder / "stderr").open("w") as errors:
            process = subprocess.Popen(
                [sys.executable, *program, *given],
                cwd=folder,
                env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)},
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
            )
        wait_for(lambda caught=process: catches(caught, signal.SIGTERM), process)
        time.sleep(draws.uniform(0.0, 20.0))
        process.send_signal(number)
        ended(process, folder, number)
        assert "Traceback" not in (folder / "stderr").read_text()
