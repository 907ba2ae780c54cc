"""A policy that is handed on acts as it did, is verified, and does not pretend to be a run."""

import json
import re
import shutil

import numpy as np
import pytest
import torch

from tests.forgery import forge
from tests.runs.test_checkpoint import SIGNATURE
from tests.training.test_loop import tiny
from warp_torchrl import load_policy
from warp_torchrl.commands.export import main
from warp_torchrl.env.metrics import METRICS
from warp_torchrl.evaluation.report import report, write_json
from warp_torchrl.models import ACTION
from warp_torchrl.models.trust import Trust
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import export as exports
from warp_torchrl.runs import safe_weights
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.policies.card import card
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.safe_weights import SAFE_WEIGHTS

MEASURED = ("kept", "again", "other", "told")


def episodes(value):
    """Two episodes with all metrics of one value."""
    return {name: np.full(2, value) for name in METRICS}


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
    assert sorted(each.name for each in exported.iterdir()) == [
        "README.md",
        "config.json",
        "manifest.json",
        "policy.pt",
    ]
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
    found, _ = checkpoints.newest(tmp_path / "run")
    content = json.loads((found.path / "config.json").read_text())
    content["values"]["model"]["actor_hidden"] = [8192] * 60  # 16 GB of parameters
    (found.path / "config.json").write_text(json.dumps(content))
    forge(found.path)
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path / "run"), str(tmp_path / "made")])
    assert end.value.code == 4
    told = "the parameters have other names or shapes than the networks that it is said to have"
    assert told in capsys.readouterr().err and not (tmp_path / "made").exists()


def test_safetensors_hold_the_same_bits_and_act_alike(run, tmp_path):
    pytest.importorskip("safetensors")
    main([str(run), str(tmp_path / "safe"), "format=safetensors"])
    assert sorted(path.suffix for path in (tmp_path / "safe").iterdir()) == [".json", ".json", ".md", ".safetensors"]
    ours, theirs = newest(tmp_path / "safe")[0].policy(), newest(run)[0].policy()
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        assert ours[name].dtype == value.dtype and ours[name].numpy().tobytes() == value.numpy().tobytes()
    now = tiny(tmp_path / "other").env.reset()
    acted = [load_policy(each, "deterministic")(now.clone())[ACTION] for each in (tmp_path / "safe", run)]
    assert torch.equal(*acted)
    main([str(tmp_path / "safe"), str(tmp_path / "back")])
    assert all(torch.equal(value, theirs[name]) for name, value in newest(tmp_path / "back")[0].policy().items())


def test_an_altered_file_of_safetensors_is_refused(run, tmp_path):
    pytest.importorskip("safetensors")
    main([str(run), str(tmp_path / "safe"), "format=safetensors"])
    path = tmp_path / "safe" / SAFE_WEIGHTS
    path.write_bytes(b"\x80" + path.read_bytes()[1:])
    with pytest.raises(CheckpointError, match="altered"):
        load_policy(tmp_path / "safe")
    forge(tmp_path / "safe")
    with pytest.raises(CheckpointError, match=r"policy.safetensors cannot be read"):
        load_policy(tmp_path / "safe")


def test_safetensors_without_the_library_is_one_line(run, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(safe_weights, "find_spec", lambda name: None)
    with pytest.raises(SystemExit) as refused:
        main([str(run), str(tmp_path / "safe"), "format=safetensors"])
    assert refused.value.code == 2 and not (tmp_path / "safe").exists()
    assert 'pip install "warp_torchrl[safetensors]"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["FOLDER", "format=onx"], "format must be one of checkpoint, safetensors, onnx, torch_export, got onx"),
        (["format=torch_export"], "FOLDER must be given with format=torch_export"),
        (["FOLDER", "format=torch_export", "--trust", "1"], "make a checkpoint: export that first, then with format="),
        (["FOLDER", "measured=here"], "measured must be a list of folders, measured=[here], got here"),
        (["FOLDER", "measured=[.]"], "evaluation.json"),
    ],
)
def test_what_cannot_be_exported_is_one_line(run, tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as refused:
        main([str(run), *arguments])
    assert refused.value.code and said in capsys.readouterr().err.splitlines()[-1] and not list(tmp_path.iterdir())


def test_a_policy_keeps_the_evaluation_of_its_run_until_it_is_changed(run, tmp_path, capsys):
    shutil.copytree(run, tmp_path / "run")
    few = {"saved": np.array([0.5, 0.7])}
    content = report("ring", "mine", 7, episodes(0.0) | few, {"noop": episodes(0.0)}, frames=64)
    write_json(tmp_path / "run" / "evaluation.json", content)
    main([str(tmp_path / "run"), str(tmp_path / "kept")])
    main([str(tmp_path / "kept"), str(tmp_path / "again")])
    main([str(tmp_path / "kept"), str(tmp_path / "other"), "--average", str(run)])
    main([str(tmp_path / "other"), str(tmp_path / "told"), f"measured=[{tmp_path / 'run'}]"])
    kept, again, other, told = (newest(tmp_path / name)[0].manifest.measured for name in MEASURED)
    assert kept == again == told and not other
    (result,) = kept
    assert (result.worlds, result.fires, result.first_seed, result.metric) == ("ring", 2, 7, "saved")
    assert result.reached.mean == pytest.approx(0.6) and result.differences["noop"].mean == pytest.approx(0.6)
    content = report("ring", "mine", 7, episodes(0.0), {}, frames=32)  # of an older checkpoint
    write_json(tmp_path / "run" / "evaluation.json", content)
    main([str(tmp_path / "run"), str(tmp_path / "older")])
    assert not newest(tmp_path / "older")[0].manifest.measured
    (tmp_path / "run" / "evaluation.json").write_text("{}")
    main([str(tmp_path / "run"), str(tmp_path / "damaged")])
    assert "skipped: " in capsys.readouterr().err and not newest(tmp_path / "damaged")[0].manifest.measured


def test_without_a_folder_the_card_is_printed(run, tmp_path, capsys):
    main([str(run)])
    assert capsys.readouterr().out == card(newest(run)[0], run.name)
