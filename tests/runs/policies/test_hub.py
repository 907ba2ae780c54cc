"""Policies from repositories of Hugging Face: plain files alone, verified, and one line where they cannot be had."""

import shutil
from pathlib import Path

import pytest
import torch

from warp_torchrl import load_policy
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.export import export
from warp_torchrl.runs.policies import hub
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.named_policy import NamedPolicy

hub_library = pytest.importorskip("huggingface_hub")
pytest.importorskip("safetensors")


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A folder that stands for a repository, with a file of code beside the policy."""
    export(newest(find_policy("single"))[0], tmp_path / "repository", is_safe=True)
    (tmp_path / "repository" / "policy.pt").write_bytes(b"a pickle")
    (tmp_path / "repository" / "code.py").write_text("raise SystemExit")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asked = []

    def fetch(name, *, revision, local_dir, allow_patterns):
        asked.append((name, revision))
        Path(local_dir).mkdir(parents=True, exist_ok=True)
        for pattern in allow_patterns:
            for path in (tmp_path / "repository").glob(pattern):
                shutil.copy(path, local_dir)
        return str(local_dir)

    monkeypatch.setattr(hub_library, "snapshot_download", fetch)
    return tmp_path / "repository", asked


def test_a_policy_of_a_repository_is_the_one_that_was_put_there(repository):
    ours, theirs = load_policy("hf://owner/name@v1").state_dict(), load_policy("single").state_dict()
    assert ours.keys() == theirs.keys() and all(torch.equal(ours[name], theirs[name]) for name in ours)
    assert repository[1] == [("owner/name", "v1")]
    assert NamedPolicy("hf://owner/name").checkpoint.manifest.scenario == "single"


def test_nothing_else_is_downloaded(repository):
    folder = find_policy("hf://owner/name")
    assert sorted(path.name for path in folder.iterdir()) == ["config.json", "manifest.json", "policy.safetensors"]


def test_a_repository_with_a_pickle_alone_is_refused(repository):
    (repository[0] / "policy.safetensors").unlink()
    with pytest.raises(CheckpointError, match=r"hf://owner/name has no policy.safetensors: export a policy with form"):
        load_policy("hf://owner/name")


def test_an_altered_repository_is_refused(repository):
    path = repository[0] / "policy.safetensors"
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    with pytest.raises(CheckpointError, match="altered"):
        load_policy("hf://owner/name")


def test_a_download_that_fails_is_one_line(repository, monkeypatch):
    def fails(*args, **named):
        raise RuntimeError("no such repository\nand a page of more")

    monkeypatch.setattr(hub_library, "snapshot_download", fails)
    with pytest.raises(CheckpointError, match=r"hf://owner/name cannot be downloaded: no such repository$"):
        load_policy("hf://owner/name")


def test_without_the_library_it_is_one_line(monkeypatch):
    monkeypatch.setattr(hub, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r'needs huggingface_hub, not installed: pip install "warp_torchrl\[hub\]"'):
        load_policy("hf://owner/name")


@pytest.mark.parametrize("address", ["hf://", "hf://name", "hf://a/b/c", "hf://a/../b", "hf://a/b@..", "hf://-a/b"])
def test_an_address_is_checked(address):
    with pytest.raises(ConfigError, match="a repository must be hf://OWNER/NAME"):
        load_policy(address)
