"""Recordings in folders: whole or not there, verified, and never executed."""

import json

import pytest
import torch
from tensordict import TensorDict

from warp_torchrl.demonstrations.files import MANIFEST, find, read, save
from warp_torchrl.runs.sealed import Unsound, described, sealed


@pytest.fixture
def folder(recording, tmp_path):
    return save(recording, tmp_path / "people")


def reseal(folder, **changes):
    """Change what a manifest says as somebody would who knows how it is sealed."""
    content = json.loads((folder / MANIFEST).read_text()) | changes
    content.pop("sha256")
    content["files"] = described(folder, content["files"])
    (folder / MANIFEST).write_bytes(sealed(content))


def test_what_is_read_is_what_was_saved(recording, folder):
    found = read(folder)
    assert (found.steps == recording.steps).all() and set(found.steps.keys(True)) == set(recording.steps.keys(True))
    for name in ("environment", "seed", "events", "policy", "frames", "agents", "actions", "saved"):
        assert getattr(found, name) == getattr(recording, name), name


def test_tensordict_reads_its_steps_too(recording, folder):
    assert (TensorDict.load_memmap(folder / "steps") == recording.steps).all()


def test_recordings_of_the_same_fire_have_folders_of_their_own(recording, tmp_path):
    names = [save(recording, tmp_path).name for _ in range(3)]
    assert names == [f"skirmish-{recording.seed}-{number}" for number in (1, 2, 3)]
    assert [each.name for each in find(tmp_path)] == names
    assert find(tmp_path / names[1]) == [tmp_path / names[1]]


def test_a_folder_without_one_is_told(tmp_path):
    with pytest.raises(Unsound, match="holds no recording"):
        find(tmp_path)


def test_a_full_disk_leaves_nothing(recording, tmp_path, monkeypatch):
    def full(*given, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(TensorDict, "memmap", full)
    with pytest.raises(OSError, match="No space"):
        save(recording, tmp_path / "people")
    assert list((tmp_path / "people").iterdir()) == []


def test_a_disk_without_room_is_told_before_memory_is_mapped_onto_it(recording, tmp_path, monkeypatch):
    def full(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    monkeypatch.setattr(TensorDict, "memmap", lambda *given, **more: pytest.fail("it would kill the process"))
    with pytest.raises(OSError, match="No space"):
        save(recording, tmp_path / "people")
    assert list((tmp_path / "people").iterdir()) == []


def test_every_altered_file_is_found(folder):
    for path in sorted(each for each in folder.rglob("*") if each.is_file()):
        kept = path.read_bytes()
        path.write_bytes(kept[:-1] + bytes([kept[-1] ^ 1]))
        with pytest.raises(Unsound):
            read(folder)
        path.write_bytes(kept)
    read(folder)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"format": 99}, "format 99"),
        ({"seed": -1}, "a whole number"),
        ({"steps": 11}, "does not fit its file"),
        ({"agents": ["one"]}, "not a recording"),
        ({"events": [{"step": 1, "kind": "explode", "numbers": [1, 1]}]}, "an event must be one of"),
        ({"events": [{"step": 1, "kind": "ignite", "numbers": [1, float("nan")]}]}, "two finite numbers"),
        ({"entries": {"../../etc/passwd": {"dtype": "uint8", "shape": [12]}}}, "has no file of its own"),
        ({"entries": {"agents/action": {"dtype": "object", "shape": [12, 3]}}}, "not a recording"),
        ({"saved": 1.5}, "a share in 0..1"),
        ({"saved": "all"}, "a share in 0..1"),
        ({"environment": {"choices": {}, "values": {}}}, "no scenario"),
    ],
)
def test_what_a_recording_says_is_checked_and_told_in_one_line(folder, changes, told):
    reseal(folder, **changes)
    with pytest.raises(Unsound, match=told) as raised:
        read(folder)
    assert "\n" not in str(raised.value)


def test_an_action_that_is_none_is_refused(folder):
    found = TensorDict.load_memmap(folder / "steps")
    found["agents", "action"][3, 1] = 11
    reseal(folder)
    with pytest.raises(Unsound, match="action must be one of 11 actions"):
        read(folder)


def test_a_pickle_beside_the_tensors_is_not_read(recording, folder):
    (folder / "steps" / "other.pickle").write_bytes(b"cos\nsystem\n(S'touch hacked'\ntR.")
    assert torch.equal(read(folder).steps["agents", "action"], recording.steps["agents", "action"])
