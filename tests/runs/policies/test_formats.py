"""Exported actors choose as the policy does, run by libraries that know nothing of this project."""

import json

import pytest
import torch
from torchrl.envs.utils import set_exploration_type

from tests.runs.policies.test_actor import FLOAT, KINDS, lively
from tests.world.mechanics.there import can_play
from warp_torchrl import load_policy, make_env
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.models.networks import Network
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.policies import formats
from warp_torchrl.runs.policies.actor import Actor
from warp_torchrl.runs.policies.described import TOLERANCE
from warp_torchrl.runs.policies.formats import FILES, check, onnx_run, save_actor
from warp_torchrl.runs.policies.trained import MODES, scores
from warp_torchrl.system.shipped import policy_names


def needs_onnx():
    for name in formats._NEEDS:
        pytest.importorskip(name)


def thousand(name):
    """The actor of a shipped policy, 1000 observations on the way, mask last, and the policy's actions and logits."""
    policy = load_policy(name)
    for network in (each for each in policy.modules() if isinstance(each, Network)):
        network.dtype = "float32"
    actor = Actor(policy)
    env = make_env("default", n_worlds=25, overrides=policy.overrides, seed=1_000_000)
    with set_exploration_type(MODES["deterministic"]):
        rollout = env.rollout(10, policy)
        acted = policy(rollout.exclude("next").flatten().select(*policy.in_keys))
    keys = [*actor.entries.values(), ACTION_MASK]
    return actor, [acted[key].flatten(0, 1) for key in keys], acted[ACTION].flatten(), scores(acted).flatten(0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("format", FILES)
@pytest.mark.parametrize("name", policy_names())
def test_a_shipped_policy_chooses_alike_on_a_thousand_observations(name, format, tmp_path):
    if format == "onnx":
        needs_onnx()
    actor, inputs, actions, logits = thousand(name)
    save_actor(actor, tmp_path / FILES[format], format)
    if format == "onnx":
        run = onnx_run(tmp_path / FILES[format])
    else:
        program = torch.export.load(tmp_path / FILES[format]).module()
        run = lambda given: program(*given)  # noqa: E731
    chosen, found = run(inputs)
    assert len(chosen) == 1000 and len(set(chosen.tolist())) > 5
    assert torch.equal(chosen, actions) and (found - logits).abs().max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", [each for each in KINDS if each != "one network"])
def test_every_kind_of_actor_is_exported(name, tmp_path):
    needs_onnx()
    if not can_play(KINDS[name]):
        pytest.skip("its mechanic is not there")
    actor = Actor(lively(*KINDS[name])[0])
    assert check(actor, save_actor(actor, tmp_path / "actor.onnx", "onnx")) < TOLERANCE


def test_what_differs_is_not_kept():
    actor = Actor(lively(*FLOAT)[0])
    with pytest.raises(CheckpointError, match=r"differs from the policy by 0\.01"):
        check(actor, lambda inputs: [each + 0.01 * each.is_floating_point() for each in actor(*inputs)])
    with pytest.raises(CheckpointError, match="chooses other actions"):
        check(actor, lambda inputs: [each + (each.dtype == torch.int64) for each in actor(*inputs)])
    with pytest.raises(CheckpointError, match="differs from the policy by nan"):
        check(actor, lambda inputs: [each * (1 if each.dtype == torch.int64 else torch.nan) for each in actor(*inputs)])


def test_onnx_without_its_libraries_is_one_line(monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r'onnxruntime, not installed: pip install "warp_torchrl\[onnx\]"'):
        formats.check_format("onnx")
    formats.check_format("torch_export")


def test_a_description_names_everything_that_goes_in_and_out(tmp_path, capsys):
    from warp_torchrl.commands.export import main

    main(["generalist", str(tmp_path / "actor"), "format=torch_export"])
    assert "actor.pt2, actions as of the policy" in capsys.readouterr().out
    assert sorted(each.name for each in (tmp_path / "actor").iterdir()) == ["README.md", "actor.json", "actor.pt2"]
    told = json.loads((tmp_path / "actor" / "actor.json").read_text())
    actor = Actor(load_policy("generalist"))
    assert [each["name"] for each in told["inputs"]] == [*actor.reads]
    assert [each["name"] for each in told["outputs"]] == [*actor.writes]
    for each, (name, entry) in zip(told["inputs"], actor.signature.observation.items(), strict=False):
        assert (each["name"], each["names"], each["shape"]) == (name, [*entry.names], ["n", *entry.shape])
        assert each["meanings"].keys() == {*entry.names} and all(each["meanings"].values())
    view = told["inputs"][3]
    assert view["meanings"]["age"] == "the ages of trees, 25 a year of ten" and view["highest"][2] == 250
    assert "baseline dispatch" in told["notes"][1] and "its logit is raised" in told["notes"][1]
