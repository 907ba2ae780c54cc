"""Recordings in folders: whole or not there, verified, and never executed."""

import json
import math
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256

import pytest
import torch
from tensordict import TensorDict

from warp_torchrl.demonstrations.files import MANIFEST, find_recordings, read_recording, save_recording
from warp_torchrl.system.checksummed import Unsound, checksummed, described


@pytest.fixture
def folder(recording, tmp_path):
    return save_recording(recording, tmp_path / "people")


def reseal(folder, **changes):
    """Change what a manifest says as somebody would who knows how it is sealed."""
    content = json.loads((folder / MANIFEST).read_text()) | changes
    content.pop("sha256")
    ours = [name for name in content["files"] if name.startswith("steps/") and (folder / name).is_file()]
    content["files"] |= described(folder, ours)
    (folder / MANIFEST).write_bytes(checksummed(content))


def test_what_is_read_is_what_was_saved(recording, folder):
    found = read_recording(folder)
    assert (found.steps == recording.steps).all() and set(found.steps.keys(True)) == set(recording.steps.keys(True))
    for name in ("environment", "seed", "events", "policy", "frames", "agents", "actions", "saved"):
        assert getattr(found, name) == getattr(recording, name), name


def test_tensordict_reads_its_steps_too(recording, folder):
    assert (TensorDict.load_memmap(folder / "steps") == recording.steps).all()


def test_recordings_of_the_same_fire_have_folders_of_their_own(recording, tmp_path):
    names = [save_recording(recording, tmp_path).name for _ in range(3)]
    assert names == [f"skirmish-{recording.seed}-{number}" for number in (1, 2, 3)]
    assert [each.name for each in find_recordings(tmp_path)] == names
    assert find_recordings(tmp_path / names[1]) == [tmp_path / names[1]]


def test_a_folder_without_one_is_told(tmp_path):
    with pytest.raises(Unsound, match="holds no recording"):
        find_recordings(tmp_path)


def test_a_full_disk_leaves_nothing(recording, tmp_path, monkeypatch):
    def full(*given, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(TensorDict, "memmap", full)
    with pytest.raises(OSError, match="No space"):
        save_recording(recording, tmp_path / "people")
    assert list((tmp_path / "people").iterdir()) == []


def test_a_disk_without_room_is_told_before_memory_is_mapped_onto_it(recording, tmp_path, monkeypatch):
    def full(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    monkeypatch.setattr(TensorDict, "memmap", lambda *given, **more: pytest.fail("it would kill the process"))
    with pytest.raises(OSError, match="No space"):
        save_recording(recording, tmp_path / "people")
    assert list((tmp_path / "people").iterdir()) == []


def test_a_disk_that_is_full_when_torch_writes_is_told_as_one(recording, tmp_path, monkeypatch):
    def full(*given, **more):
        raise RuntimeError("unable to write to file </a/action.memmap>: No space left on device (28)")

    monkeypatch.setattr(TensorDict, "memmap", full)
    with pytest.raises(OSError, match="No space") as raised:
        save_recording(recording, tmp_path / "people")
    assert raised.value.errno == 28 and raised.value.filename and list((tmp_path / "people").iterdir()) == []


def test_every_altered_file_is_found(folder):
    for path in sorted(each for each in folder.rglob("*") if each.is_file()):
        kept = path.read_bytes()
        path.write_bytes(kept[:-1] + bytes([kept[-1] ^ 1]))
        with pytest.raises(Unsound):
            read_recording(folder)
        path.write_bytes(kept)
    read_recording(folder)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"format": 99}, "format 99"),
        ({"seed": -1}, "a whole number"),
        ({"steps": 11}, r"must be uint8 \[11, 3, 11, 7, 7\], got uint8 \[12, "),
        ({"steps": 0}, r"must be uint8 \[0, 3"),
        ({"agents": ["one"]}, "not a recording"),
        ({"events": [{"step": 1, "kind": "explode", "numbers": [1, 1]}]}, "an event must be one of"),
        ({"events": [{"step": 1, "kind": "ignite", "numbers": [1, float("nan")]}]}, "NaN is no number"),
        ({"events": [{"step": 1, "kind": "ignite", "numbers": [1]}]}, "two finite numbers"),
        ({"events": [{"step": 13, "kind": "ignite", "numbers": [1, 1]}]}, "an event must come before one of 12 steps"),
        ({"entries": {"../../etc/passwd": {"dtype": "uint8", "shape": [12]}}}, "is none of a recording"),
        ({"entries": {"agents/action": {"dtype": "object", "shape": [12, 3]}}}, "must be of type bool, uint8"),
        ({"entries": {"agents/action": {"dtype": "int64", "shape": [2**62, 2**62]}}}, r"must be int64 \[12, 3\]"),
        ({"entries": {"agents/action": {"dtype": "int64", "shape": [12, 3]}}}, "entry agents/.* is missing"),
        ({"entries": 7}, "not a recording"),
        ({"agents": ["a"] * 3}, "agents must be 1 to 256 names, each once"),
        ({"agents": [f"{number}" for number in range(9999)]}, "agents must be 1 to 256 names"),
        ({"agents": [1, 2, 3]}, "a text of at most"),
        ({"policy": "a" * 9999}, "a text of at most 1000 characters is expected, got .{80}$"),
        ({"frames": True}, "a whole number"),
        ({"saved": 1.5}, "a share in 0..1"),
        ({"saved": "all"}, "a share in 0..1"),
        ({"environment": {"choices": {}, "values": {}}}, "no scenario"),
        ({"environment": {"choices": {"scenario": "../x"}, "values": {}}}, "no scenario"),
        ({"environment": {"choices": {"scenario": 1}, "values": {}}}, "choices must be names"),
        ({"environment": 1}, "choices and values"),
        ({"environment": {"choices": {}, "values": {"a": json.loads("[" * 99 + "]" * 99)}}}, "at most 20 deep"),
    ],
)
def test_what_a_recording_says_is_checked_and_told_in_one_line(folder, changes, told):
    reseal(folder, **changes)
    with pytest.raises(Unsound, match=told) as raised:
        read_recording(folder)
    assert "\n" not in str(raised.value)


def test_an_event_may_come_after_the_last_step(folder):
    reseal(folder, events=[{"step": 12, "kind": "ignite", "numbers": [1, 1]}])
    assert read_recording(folder).events[0].step == 12


@pytest.mark.parametrize(
    ("entry", "number", "told"),
    [
        ("agents/action", 11, "action must be one of 11 everywhere"),
        ("agents/action", -1, "action must be one of 11"),
        ("agents/proposed", 2**62, "proposed must be one of 11"),
        ("agents/role", 2**62, "role must be one of 5"),
        ("agents/mover", 255, "mover must be one of 5"),
        ("agents/observation/view", math.nan, "agents/observation/view must hold finite numbers alone, got nan"),
        ("agents/observation/view", math.inf, "finite numbers alone, got inf"),
        ("next/agents/reward", -math.inf, "next/agents/reward must hold finite numbers alone, got -inf"),
    ],
)
def test_a_number_that_no_environment_shows_is_refused(recording, tmp_path, entry, number, told):
    recording.steps["agents", "observation", "view"] = recording.steps["agents", "observation", "view"].float()
    folder = save_recording(recording, tmp_path)
    found = TensorDict.load_memmap(folder / "steps")
    found[tuple(entry.split("/"))][3].view(-1)[-1] = number
    reseal(folder)
    with pytest.raises(Unsound, match=told):
        read_recording(folder)


@pytest.mark.parametrize(
    ("entry", "at", "byte", "told"),
    [
        ("agents/action_mask", slice(0, 11), 0, "must leave each agent an action in every step"),
        ("agents/action_mask", slice(5, 6), 2, "must hold true and false alone"),
        ("next/done", slice(0, 1), 1, "must end with the last step"),
    ],
)
def test_flags_that_no_environment_shows_are_refused(folder, entry, at, byte, told):
    path = folder / "steps" / f"{entry}.memmap"
    content = bytearray(path.read_bytes())
    content[at] = bytes([byte] * len(content[at]))
    path.write_bytes(content)
    reseal(folder)
    with pytest.raises(Unsound, match=told):
        read_recording(folder)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("../secret", "no plain name below it|is none of a recording"),
        ("/proc/kmsg", "is none of a recording"),
        ("steps/../../secret/meta.json", "no plain name below it"),
        ("steps/link/meta.json", "is a link"),
        ("steps/pipe/meta.json", "is no file"),
        ("steps/folder/meta.json", "is no file"),
    ],
)
def test_a_manifest_names_files_below_its_folder_alone(folder, name, told):
    (folder.parent / "secret").write_text("secret")
    for made in ("link", "pipe", "folder"):
        (folder / "steps" / made).mkdir()
    (folder / "steps" / "link" / "meta.json").symlink_to(folder.parent / "secret")
    os.mkfifo(folder / "steps" / "pipe" / "meta.json")
    (folder / "steps" / "folder" / "meta.json").mkdir()
    content = json.loads((folder / MANIFEST).read_text())
    reseal(folder, files=content["files"] | {name: {"size": 6, "sha256": sha256(b"secret").hexdigest()}})
    with pytest.raises(Unsound, match=told):
        read_recording(folder)


def test_a_manifest_that_is_a_link_or_a_pipe_is_refused(folder):
    (folder / MANIFEST).rename(folder / "other.json")
    (folder / MANIFEST).symlink_to(folder / "other.json")
    with pytest.raises(Unsound, match="is a link"):
        read_recording(folder)
    (folder / MANIFEST).unlink()
    os.mkfifo(folder / MANIFEST)
    with pytest.raises(Unsound, match="is no file"):
        read_recording(folder)


def test_an_entry_that_is_not_as_large_as_its_file_is_refused(folder):
    entries = json.loads((folder / MANIFEST).read_text())["entries"]
    reseal(folder, entries=entries | {"agents/observation/view": {"dtype": "uint8", "shape": [12, 3, 7]}})
    with pytest.raises(Unsound, match=r"view\.memmap does not fit its file, of 19404 bytes and not 252"):
        read_recording(folder)


def test_files_larger_than_a_recording_may_be_are_not_read(folder):
    content = json.loads((folder / MANIFEST).read_text())
    size = 2**40
    with (folder / "steps" / "agents" / "observation" / "view.memmap").open("r+b") as file:
        file.truncate(size)  # sparse: it takes no room
    content["entries"]["agents/observation/view"] = {"dtype": "uint8", "shape": [12, 3, size // 36 + 1]}
    content["files"]["steps/agents/observation/view.memmap"]["size"] = 12 * 3 * (size // 36 + 1)
    content.pop("sha256")
    (folder / MANIFEST).write_bytes(checksummed(content))
    with pytest.raises(Unsound, match="at most 4294967296 are read"):
        read_recording(folder)


def test_no_link_is_followed_and_odd_names_are_left_with_a_line(folder, recording, caplog):
    people = folder.parent
    for name in ("odd name", "<b>", ".hidden"):
        shutil.copytree(folder, people / name)
    (people / "more").mkdir()
    save_recording(recording, people / "more" / ".deep")
    (people / "loop").symlink_to(people)
    for _ in range(2):
        assert find_recordings(people) == [folder]
    assert sorted(caplog.messages) == [
        f"{people / name} is left: folders of recordings have names of A-Z, a-z, 0-9, '.', '_' and '-' alone"
        for name in ("<b>", "odd name")
    ]


def test_savers_at_once_keep_what_each_has_saved(recording, tmp_path):
    people = tmp_path / "people"
    short = replace(recording, steps=recording.steps[:5], events=(), policy="short")
    with ThreadPoolExecutor(4) as pool:
        folders = list(pool.map(lambda number: save_recording((recording, short)[number % 2], people), range(12)))
    assert sorted(folders) == find_recordings(people)
    for number, path in enumerate(folders):
        assert len(read_recording(path).steps) == (12, 5)[number % 2]
    assert {each.name for each in people.iterdir()} == {each.name for each in folders}


def test_a_save_that_is_not_read_again_leaves_nothing(recording, tmp_path):
    recording.steps["next", "agents", "reward"][3, 1] = math.nan
    with pytest.raises(Unsound, match="finite numbers alone"):
        save_recording(recording, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_pickle_beside_the_tensors_is_not_read(recording, folder):
    (folder / "steps" / "other.pickle").write_bytes(b"cos\nsystem\n(S'touch hacked'\ntR.")
    assert torch.equal(read_recording(folder).steps["agents", "action"], recording.steps["agents", "action"])
