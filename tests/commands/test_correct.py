"""The command that records a scripted person's corrections."""

import re

import pytest

from warp_torchrl.commands.correct import main, read_session
from warp_torchrl.commands.correction import Session
from warp_torchrl.demonstrations.files import find_recordings
from warp_torchrl.demonstrations.files import read_recording as read_recording
from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.demonstrations.scripted import Person
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.system.lock import RunFolderLock


def test_the_command_writes_recordings_that_replay_and_prints_a_table(weak_run, tmp_path, capsys):
    assert main([f"policy={weak_run}", f"out={tmp_path / 'people'}", "episodes=2", "threshold=1", "delay=0"]) == 0
    row = capsys.readouterr().out.splitlines()[-1]
    recordings = [read_recording(path) for path in find_recordings(tmp_path / "people")]
    for each in recordings:
        Replay(each).check()
        assert each.frames == newest(weak_run)[0].manifest.frames and each.policy == str(weak_run)
    acts, steps = (
        sum(int(each.by(Mover.PERSON).sum()) for each in recordings),
        sum(len(each.steps) for each in recordings),
    )
    found = re.fullmatch(r"\| skirmish \| 2 \| (\d+) \| (\d+) \| (\d+) \| (\d+\.\d) \| (\d+\.\d) \|", row)
    assert found and [int(each) for each in found.groups()[:2]] == [steps, acts] and 0 < int(found[3]) <= acts
    assert main([f"policy={weak_run}", f"out={tmp_path / 'people'}"]) == 2
    assert "out must be a new folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["policy=coordinated", "out=x"], "policy must be a trained one, which tells how sure it is, got coordinated"),
        (["policy=nobody", "out=x"], "policy must be one of"),
        (["out=x"], "policy must be given"),
        (["policy=default"], "out must be given"),
        (["policy=default", "out=x", "episodes=0"], "episodes must be in"),
        (["policy=default", "out=x", "delay=soon"], "delay must be a whole number"),
        (["policy=default", "out=x", "by=ring"], "by must be one of"),
        (["policy=default", "out=x", "observation=paper"], "the policy default does not fit here"),
        (["policy=default", "out=x", "team.n_agent=3"], "did you mean team.n_agents"),
    ],
)
def test_a_mistake_is_told_in_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and said in told[0]
    assert not (tmp_path / "x").exists()


def test_every_key_is_read():
    given = ["policy=a", "out=b", "episodes=5", "acts=7", "seed=3", "by=local", "delay=2", "error=0.25", "threshold=1"]
    session, person = read_session([*given, "team.n_agents=3"])
    assert session == Session(policy="a", out="b", episodes=5, acts=7, seed=3, overrides=("team.n_agents=3",))
    assert person == Person(by="local", delay=2, error=0.25, threshold=1.0)
    assert read_session(["policy=1", "out=2020-01-01", "acts=null"])[0] == Session(policy="1", out="2020-01-01")


def test_help_names_every_key(capsys):
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(f"{key}" in told for key in ("policy", "out", "episodes", "acts", "delay", "error", "threshold", "seed"))


def test_one_command_at_a_time_writes_into_a_folder(tmp_path, capsys):
    lock = RunFolderLock(tmp_path / "people")
    assert main(["policy=skirmish", f"out={tmp_path / 'people'}", "episodes=1"]) == 3
    assert capsys.readouterr().err == f"error: {tmp_path / 'people'} is in use: another process writes into it\n"
    lock.release()
    assert main(["policy=nobody", f"out={tmp_path / 'new'}"]) == 2
    assert not (tmp_path / "new").exists()
