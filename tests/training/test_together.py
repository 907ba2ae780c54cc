"""Trainings of two processes: they learn as one, go on exactly, and end with a line where one of them is killed."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
import torch

from tests.demonstrations.played import played
from tests.stress.processes import ROOT, TINY, alive, finish, rows, start, wait_for
from tests.training.test_loop import flattened
from warp_torchrl.commands.command import train as train_here
from warp_torchrl.demonstrations.files import save_recording
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain

LENGTH = ("processes=2", "total_frames=256", "checkpoint.interval=64", "checkpoint.keep=9")


def train(folder, *overrides):
    folder.mkdir()
    finish(folder, *TINY, *LENGTH, "hydra.run.dir=run", *overrides)
    return folder / "run"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run whose first process is this one."""
    folder = tmp_path_factory.mktemp("together")
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["train.py", *TINY, *LENGTH, "hydra.run.dir=run", "reward.normalise=true"])
        train_here()
    assert end.value.code == 0
    return folder / "run"


def gone(session, seconds=10.0):
    """Return whether a session's processes end, those included that clean up after a killed one."""
    deadline = time.monotonic() + seconds
    while alive(session) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not alive(session)


def told(run):
    with (run / "metrics.csv").open(newline="") as file:
        found = list(csv.DictReader(file))
    return [{key: value for key, value in row.items() if key not in ("time/seconds", "time/fps")} for row in found]


@pytest.mark.slow
def test_a_checkpoint_holds_the_worlds_of_both(whole):
    state = newest(whole)[0].training()
    seeds = [state["collection"]["env"]["seeds"], state["others"][0]["collection"]["env"]["seeds"]]
    assert torch.cat(seeds).tolist() == [0, 1, 2, 3]  # as one process has them
    assert not torch.equal(state["random"], state["others"][0]["random"])
    assert state["frames"] == 256
    assert [int(row["time/frames"]) for row in told(whole)] == list(range(32, 257, 32))
    assert json.loads((newest(whole)[0].path / "config.json").read_text())["values"]["processes"] == 2
    assert (whole / "evaluation.json").exists()


@pytest.mark.slow
def test_two_processes_learn_from_people_together_and_go_on_exactly(tmp_path):
    for seed in range(2):
        save_recording(played("horizon=16", seed=seed), tmp_path / "people")
    people = [f"imitation.demonstrations={tmp_path / 'people'}", "imitation.until=1.0", "imitation.minibatch_size=32"]
    whole = train(tmp_path / "whole", *people)
    losses = [float(row["train/cloning_loss"]) for row in told(whole)]
    assert losses[0] > losses[-1] > 0.0
    state = newest(whole)[0].training()
    first, second = (each["keeps"]["demonstrations"] for each in (state, state["others"][0]))
    assert first["recordings"] == second["recordings"] and not torch.equal(first["random"], second["random"])
    cut = train(tmp_path / "cut", *people)
    for path in sorted((cut / "checkpoints").iterdir())[1:]:
        shutil.rmtree(path)
    finish(tmp_path / "cut", "resume=run")
    ours, theirs = (flattened(newest(each)[0].training()) for each in (cut, whole))
    for name, value in theirs.items():
        if name != "/seconds":
            assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name


@pytest.mark.slow
def test_two_processes_have_one_curriculum_and_go_on_exactly(tmp_path):
    levels = ["curriculum.over.steps_per_tick=[9,6,1]", "curriculum.over.horizon=[8,10,12]", "horizon=12"]
    climbs = ["curriculum=success", *levels, "curriculum.episodes=6", "curriculum.low=0.01", "curriculum.high=0.02"]
    whole = train(tmp_path / "whole", *climbs)
    assert sorted({float(row["curriculum/level"]) for row in told(whole)}) == pytest.approx([0.2, 1.1, 2.0])
    cut = train(tmp_path / "cut", *climbs)
    for path in sorted((cut / "checkpoints").iterdir(), key=lambda each: int(each.name))[1:]:
        shutil.rmtree(path)
    finish(tmp_path / "cut", "resume=run")
    ours, theirs = (flattened(newest(each)[0].training()) for each in (cut, whole))
    assert set(ours) == set(theirs) and "/curriculum/level" in ours
    for name, value in theirs.items():
        if name != "/seconds":
            assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name
    assert told(cut) == told(whole)


@pytest.mark.slow
def test_a_run_that_is_stopped_goes_on_exactly(tmp_path, whole):
    (tmp_path / "cut").mkdir()
    command = [*TINY, *LENGTH, "hydra.run.dir=run", "reward.normalise=true"]
    process = start(tmp_path / "cut", *command)
    run = tmp_path / "cut/run"
    wait_for(lambda: rows(run) >= 2, process)
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 128 + signal.SIGTERM
    assert gone(process.pid)
    finish(tmp_path / "cut", "resume=run")
    ours, theirs = (flattened(newest(each)[0].training()) for each in (run, whole))
    assert set(ours) == set(theirs)
    for name, value in theirs.items():
        if name != "/seconds":
            assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name
    assert told(run) == told(whole)


def other_process(session, first):
    """Return the process that learns beside the first one."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        fields = path.read_text().rpartition(")")[2].split()
        command = path.with_name("cmdline").read_text()
        if int(fields[3]) == session and int(path.parent.name) != first and "training.following" in command:
            return int(path.parent.name)
    return None


@pytest.mark.slow
def test_a_killed_process_ends_the_run_with_a_line_and_a_checkpoint(tmp_path):
    command = [*TINY, *LENGTH, "hydra.run.dir=run", "total_frames=1000000", "checkpoint.interval=1000000"]
    process = start(tmp_path, *command)
    wait_for(lambda: rows(tmp_path / "run") >= 2, process)
    os.kill(other_process(process.pid, process.pid), signal.SIGKILL)
    assert process.wait(60) == 1
    line = (tmp_path / "stderr").read_text().splitlines()[-1]
    assert line == "error: a process of the run has ended: process 1 by signal 9"
    assert gone(process.pid)
    found = newest(tmp_path / "run")[0]
    assert found.manifest.frames >= 64
    finish(tmp_path, "resume=run", f"total_frames={found.manifest.frames + 64}")
    assert newest(tmp_path / "run")[0].manifest.frames == found.manifest.frames + 64


@pytest.mark.slow
def test_torchrun_starts_the_processes_itself(tmp_path):
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2", "--standalone"]
    done = subprocess.run(
        [*torchrun, ROOT / "train.py", *TINY, "total_frames=64", "hydra.run.dir=run"],
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run"]  # the second process writes nothing
    assert len(newest(tmp_path / "run")[0].training()["others"]) == 1


configured = partial(compose_config, "train")


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["processes=3"], "processes must divide n_worlds, 256, got 3"),
        (["processes=0"], "processes must divide n_worlds, 256, got 0"),
        (["processes=many"], "processes must be a whole number or auto, got 'many'"),
        (["processes=2", "collector=process"], "processes must be 1 where workers collect, got 2: choose collector="),
    ],
)
def test_what_cannot_be_shared_is_refused_in_a_line(overrides, line):
    with pytest.raises(ConfigError, match=line):
        run_config(plain(configured(overrides)))
