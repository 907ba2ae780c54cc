"""What former versions saved by the name ``self`` is read as ``status``, wherever it is read."""

import json
from collections.abc import Mapping

import pytest
import torch

from tests.demonstrations.conftest import kept_recording, recording  # noqa: F401
from tests.demonstrations.test_files import reseal
from tests.forgery import forge
from tests.training.test_loop import RUNS, TINIER, tiny
from warp_torchrl import load_policy, make_env
from warp_torchrl.demonstrations.files import MANIFEST, read_recording, save_recording
from warp_torchrl.env.observation import renamed, with_renamed
from warp_torchrl.env.specs import check_names
from warp_torchrl.runs.checkpoint import newest

NAMES = {
    "self": "status",
    "agents.observation.self": "agents.observation.status",
    "next/agents/observation/self": "next/agents/observation/status",
    "agents.canonical_self": "agents.canonical_status",
    "next.agents.canonical_sent_self": "next.agents.canonical_sent_status",
    "packets.shown.self": "packets.shown.status",
    "itself": "itself",
    "selfish": "selfish",
    "network.self_attention.weight": "network.self_attention.weight",
    "": "",
}


def formerly(content):
    """Nested mappings by the names that they had."""
    if isinstance(content, Mapping):
        return {
            key.replace("status", "self") if isinstance(key, str) else key: formerly(each)
            for key, each in content.items()
        }
    return content


@pytest.mark.parametrize(("before", "now"), NAMES.items())
def test_a_name_of_before_is_one_of_now(before, now):
    assert renamed(before) == now == renamed(now)


def test_names_are_those_of_now_at_every_depth():
    held = {"a": [{"self": 1}, ({"b.self": 2},)], 3: {"view": "self"}}
    assert with_renamed(held) == {"a": [{"status": 1}, ({"b.status": 2},)], 3: {"view": "self"}}


@pytest.mark.parametrize("name", ["regrets", "talks late"])
def test_a_run_of_before_goes_on_and_its_policy_acts(tmp_path, name):
    """Its manifest, its replay memory, the packets under way and what the collector carries name ``self``."""
    training = tiny(tmp_path, *TINIER, *RUNS[name])
    training.train()
    found, expected = newest(tmp_path)[0], newest(tmp_path)[0].training()
    state = torch.load(found.path / "training.pt", weights_only=True)
    torch.save(formerly(state), found.path / "training.pt")
    manifest = json.loads((found.path / "manifest.json").read_text())
    forge(found.path, signature=formerly(manifest["signature"]))
    again = newest(tmp_path)[0]
    assert "status" in again.manifest.signature.observation and "self" not in again.manifest.signature.observation
    assert again.manifest.signature == found.manifest.signature
    held = again.training()
    assert str(held.keys()) == str(expected.keys()) and "self" not in str(list(held["collection"]["carrier"]))
    second = tiny(tmp_path, *TINIER, *RUNS[name])
    second.load_state_dict(held)
    batch = next(second.batches())[0]
    assert "status" in batch["agents", "observation"].keys()


def test_an_environment_s_state_of_before_is_restored():
    env = make_env(
        "search", n_worlds=2, overrides=["landscape.size=12", "team.radio.carries=both", "team.radio.delay=1"]
    )
    env.rollout(3)
    state = env.state_dict()
    assert any("status" in name for name in state["worlds"])
    env.load_state_dict(formerly(state))
    assert all(torch.equal(value, state["worlds"][name]) for name, value in env.state_dict()["worlds"].items())


def test_a_recording_of_before_is_read(recording, tmp_path):  # noqa: F811
    folder = save_recording(recording, tmp_path)
    seen = folder / "steps" / "agents" / "observation"
    (seen / "status.memmap").rename(seen / "self.memmap")
    told = json.loads((folder / MANIFEST).read_text())
    files = {name.replace("/status.memmap", "/self.memmap"): entry for name, entry in told["files"].items()}
    reseal(folder, entries=formerly(told["entries"]), files=files)
    assert (read_recording(folder).steps == recording.steps).all()


@pytest.mark.parametrize("name", ["default", "generalist", "single", "skirmish"])
def test_a_shipped_policy_reads_status(name):
    assert "status" in load_policy(name).trained.observation


@pytest.mark.parametrize("name", ["self", "shape", "device", "batch_size", "lambda", "two words", "2nd", "a.b"])
def test_an_entry_that_torchrl_cannot_pass_as_a_keyword_is_refused(name):
    with pytest.raises(ValueError, match=rf"observation entries must be named by identifiers, .*, got '{name}'"):
        check_names(["view", name])
    check_names(["", "view", "status", "picture", "near", "bearing"])
