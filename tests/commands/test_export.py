"""A policy that is handed on acts as it did, is verified, and does not pretend to be a run."""

import json
import re
import shutil

import pytest
import torch

from tests.forgery import forge
from tests.runs.test_checkpoint import SIGNATURE
from tests.training.test_loop import tiny
from warp_torchrl import load_policy
from warp_torchrl.commands.export import main
from warp_torchrl.models import ACTION
from warp_torchrl.models.trust import Trust
from warp_torchrl.runs import export as exports
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.policies.find import find_policy


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    training = tiny(folder, "total_frames=64")
    training.train()
    return folder


@pytest.fixture
def exported(run, tmp_path, capsys):
    main([str(run), str(tmp_path / "policies" / "tiny")])
    assert "skirmish, 64 world steps in 1 training" in capsys.readouterr().out
    return tmp_path / "policies" / "tiny"


def test_it_acts_as_it_did(run, exported):
    env = newest(run)[0]
    assert load_policy(exported).mode == load_policy(run).mode == env.manifest.mode
    now = tiny(exported.parent / "other").env.reset()
    ours, theirs = (load_policy(each, "deterministic")(now.clone())[ACTION] for each in (exported, run))
    assert torch.equal(ours, theirs)


def test_it_holds_nothing_of_training_and_says_so(exported):
    assert sorted(each.name for each in exported.iterdir()) == ["config.json", "manifest.json", "policy.pt"]
    found, _ = newest(exported)
    assert found.saved_config().values["total_frames"] == 64 and found.manifest.signature != SIGNATURE
    with pytest.raises(CheckpointError, match="holds a policy alone: it acts, and nothing goes on from it"):
        found.training()


def test_it_does_not_tell_where_its_run_started(run, tmp_path, capsys):
    (tmp_path / "later").mkdir()
    training = tiny(tmp_path / "later", "total_frames=64", f"start_from={run}")
    training.train()
    main([str(tmp_path / "later"), str(tmp_path / "policy")])
    records = [newest(tmp_path / each)[0].saved_config() for each in ("later", "policy")]
    assert [each.values["start_from"] for each in records] == [str(run), None]
    assert records[0].values | {"start_from": None} == records[1].values and records[0].choices == records[1].choices


@pytest.mark.parametrize("name", ["policy.pt", "config.json"])
def test_it_is_verified(exported, name):
    (exported / name).write_bytes((exported / name).read_bytes()[:-1] + b"?")
    with pytest.raises(CheckpointError, match="altered"):
        load_policy(exported)


def test_a_folder_that_exists_is_left_alone(run, exported, capsys):
    before = (exported / "policy.pt").read_bytes()
    with pytest.raises(SystemExit) as refused:
        main([str(run), str(exported)])
    assert refused.value.code == 2 and "exists" in capsys.readouterr().err
    assert (exported / "policy.pt").read_bytes() == before


def test_a_checkpoint_that_lost_its_training_is_no_policy_alone(run, tmp_path):
    shutil.copytree(run / "checkpoints", tmp_path / "checkpoints")
    for each in (tmp_path / "checkpoints").iterdir():
        (each / "training.pt").unlink()
    with pytest.raises(CheckpointError, match="missing or was cut"):
        newest(tmp_path)


def test_a_disk_that_refuses_leaves_nothing(run, tmp_path, monkeypatch):
    def refuses(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(exports.shutil, "copyfile", refuses)
    with pytest.raises(SystemExit):
        main([str(run), str(tmp_path / "policy")])
    assert not (tmp_path / "policy").exists()


def test_its_agents_may_trust_their_adviser_more(tmp_path):
    main(["generalist", str(tmp_path / "trusting"), "--trust", "0.25"])
    values = [newest(find_policy(each))[0].saved_config().values for each in (tmp_path / "trusting", "generalist")]
    assert values[0]["model"] == values[1]["model"] | {"trust": 0.25}
    (trust,) = (each for each in load_policy(tmp_path / "trusting").modules() if isinstance(each, Trust))
    assert trust._gain == 2.0


def test_how_it_acts_may_be_told(run, tmp_path):
    modes = ("sampled", "deterministic")
    for mode in modes:
        main([str(run), str(tmp_path / mode), "--mode", mode])
    assert tuple(load_policy(tmp_path / mode).mode for mode in modes) == modes


def test_it_may_be_the_mean_of_several(run, tmp_path):
    (tmp_path / "other").mkdir()
    tiny(tmp_path / "other", "total_frames=64", "seed=1").train()
    main([str(run), str(tmp_path / "mean"), "--average", str(tmp_path / "other")])
    mean, ours, theirs = (newest(each)[0].policy() for each in (tmp_path / "mean", run, tmp_path / "other"))
    assert all(torch.allclose(mean[name], (ours[name] + theirs[name]) / 2) for name in ours)
    assert any(not torch.equal(ours[name], theirs[name]) for name in ours)
    assert load_policy(tmp_path / "mean").mode == load_policy(run).mode


def test_policies_of_other_networks_have_no_mean(run, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main([str(run), str(tmp_path / "mean"), "--average", "skirmish"])
    assert "skirmish is of another architecture than" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "mean").exists()


def test_trust_without_an_adviser_leaves_no_folder(run, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main([str(run), str(tmp_path / "trusting"), "--trust", "0.25"])
    said = capsys.readouterr().err.splitlines()[-1]
    assert "model.trust must be 0 where agents are not advised and told the rules" in said
    assert not (tmp_path / "trusting").exists()


@pytest.mark.parametrize("number", [float("nan"), 3e38])
def test_numbers_that_are_not_finite_are_not_exported(run, tmp_path, capsys, number):
    """NaN itself, alone or in a mean; or finite numbers whose mean is not."""
    shutil.copytree(run, tmp_path / "bad")
    path = newest(tmp_path / "bad")[0].path
    policy = {name: torch.full_like(value, number) for name, value in torch.load(path / "policy.pt").items()}
    torch.save(policy, path / "policy.pt")
    forge(path)
    bad, said = str(tmp_path / "bad"), "must hold finite numbers alone" if number != number else "mean of .* not finite"
    alone = [[bad, str(tmp_path / "out")]] if number != number else []
    for arguments in (*alone, [bad, str(tmp_path / "out"), "--average", bad]):
        with pytest.raises(SystemExit) as refused:
            main(arguments)
        assert refused.value.code == 4 and re.search(said, capsys.readouterr().err)
        assert not (tmp_path / "out").exists()


def test_networks_that_are_larger_than_the_machine_are_refused_before_they_are_made(run, tmp_path, capsys):
    shutil.copytree(run, tmp_path / "run")
    found, _ = newest(tmp_path / "run")
    content = json.loads((found.path / "config.json").read_text())
    content["values"]["model"]["actor_hidden"] = [8192] * 60  # 16 GB of parameters
    (found.path / "config.json").write_text(json.dumps(content))
    forge(found.path)
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path / "run"), str(tmp_path / "made")])
    assert end.value.code == 4
    told = "the parameters have other names or shapes than the networks that it is said to have"
    assert told in capsys.readouterr().err and not (tmp_path / "made").exists()
