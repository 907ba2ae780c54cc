"""Checkpoints are complete or invisible, and verified before they are read."""

import io
import json
import math
import os
import pickle
import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from tests.forgery import forge
from warp_torchrl.entries import Planes, to_plain
from warp_torchrl.models import Entry, Signature
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.export import export
from warp_torchrl.runs.output import DRAFT

ACTIONS = tuple(f"action_{code}" for code in range(11))
SIGNATURE = Signature({"view": Entry((3, 5, 5), "uint8")}, Entry((9, 16, 16), "float32"), 2, ACTIONS, ("ugv", "uav"))


def saved(run, frames, keep=3, signature=SIGNATURE, **options):
    return checkpoints.save(
        run,
        frames=frames,
        scenario="tiny",
        signature=signature,
        mode="sampled",
        saved_config=SavedConfig(choices={"algorithm": "mappo"}, values={"seed": 3}),
        policy={"weight": torch.arange(4.0)},
        training={"frames": frames, "random": torch.get_rng_state()},
        keep=keep,
        **options,
    )


def test_a_policy_whose_messages_come_late_is_known_as_one(tmp_path):
    late = SIGNATURE._replace(is_late=True)
    saved(tmp_path, 100, signature=late)
    assert newest(tmp_path)[0].manifest.signature == late


def test_what_was_saved_comes_back(tmp_path):
    run = tmp_path / "runs" / "of today"  # neither is there
    saved(run, 100)
    found, skipped = newest(run)
    assert not skipped and found.manifest.frames == 100 and found.manifest.signature == SIGNATURE
    assert found.policy()["weight"].tolist() == [0, 1, 2, 3] and found.training()["frames"] == 100
    assert found.saved_config() == SavedConfig(choices={"algorithm": "mappo"}, values={"seed": 3})


def test_the_newest_is_found_by_number_and_old_ones_go(tmp_path):
    for frames in (20, 900, 1000, 99_999):
        saved(tmp_path, frames, keep=3)
    assert newest(tmp_path)[0].manifest.frames == 99_999
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [900, 1000, 99_999]
    assert newest(tmp_path / "checkpoints" / "900")[0].manifest.frames == 900


def test_what_is_not_to_stay_goes_when_two_newer_ones_are_safe(tmp_path):
    for frames in (100, 130, 200, 210, 220, 300, 310, 320, 330):
        saved(tmp_path, frames, keep=4, stays=lambda each: each % 100 == 0)
        assert len(list((tmp_path / "checkpoints").iterdir())) <= 4
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [200, 300, 320, 330]


@pytest.mark.parametrize("name", ["policy.pt", "training.pt", "config.json", "manifest.json"])
@pytest.mark.parametrize("harm", ["flip", "cut", "empty", "append", "delete"])
def test_an_altered_file_is_noticed_and_the_one_before_taken(tmp_path, name, harm):
    saved(tmp_path, 1)
    path = saved(tmp_path, 2) / name
    content = bytearray(path.read_bytes())
    if harm == "delete":
        path.unlink()
    else:
        half = len(content) // 2
        flipped = content[:half] + bytes([content[half] ^ 1]) + content[half + 1 :]
        path.write_bytes({"flip": flipped, "cut": content[:half], "empty": b"", "append": content + b" x"}[harm])
    found, (line,) = newest(tmp_path)
    assert found.manifest.frames == 1 and "\n" not in line and "checkpoints/2" in line


def test_every_byte_of_a_manifest_counts(tmp_path):
    saved(tmp_path, 1)
    path = saved(tmp_path, 2) / "manifest.json"
    content = path.read_bytes()
    for place in range(0, len(content), 7):
        path.write_bytes(content[:place] + bytes([content[place] ^ (1 << place % 8)]) + content[place + 1 :])
        assert newest(tmp_path)[0].manifest.frames == 1, content[max(place - 20, 0) : place + 20]
    path.write_bytes(content)
    assert newest(tmp_path)[0].manifest.frames == 2


def test_checkpoints_that_change_places_are_noticed(tmp_path):
    first, second = saved(tmp_path, 1), saved(tmp_path, 2)
    first.rename(tmp_path / "aside")
    second.rename(first)
    (tmp_path / "aside").rename(second)
    with pytest.raises(CheckpointError, match="2 holds a checkpoint of 1 frames"):
        newest(tmp_path)
    assert newest(second)[0].manifest.frames == 1, "a single checkpoint may be anywhere"


@pytest.mark.parametrize("keep", [2, 3])
def test_a_run_that_fell_back_never_loses_what_it_then_saves(tmp_path, keep):
    """Two unsound checkpoints are newer: they must neither stand for the new one nor push it out."""
    saved(tmp_path, 100)
    for frames in (200, 300):
        (saved(tmp_path, frames, keep=9) / "policy.pt").write_bytes(b"rotten")
    assert newest(tmp_path)[0].manifest.frames == 100 and len(newest(tmp_path)[1]) == 2
    saved(tmp_path, 200, keep)
    assert newest(tmp_path)[0].manifest.frames == 200 and newest(tmp_path)[1] == []
    assert sorted(each.name for each in (tmp_path / "checkpoints").iterdir()) == ["100", "200"]


def test_a_sound_checkpoint_is_never_written_again(tmp_path):
    path = saved(tmp_path, 1) / "training.pt"
    before = path.stat()
    saved(tmp_path, 1)
    assert path.stat() == before


def test_nothing_sound_is_one_line(tmp_path):
    with pytest.raises(CheckpointError, match="no sound checkpoint") as error:
        newest(tmp_path)
    assert "\n" not in str(error.value)
    with pytest.raises(CheckpointError, match="nothing there"):
        newest(tmp_path / "elsewhere")


def test_another_format_is_refused_by_name(tmp_path):
    manifest = saved(tmp_path, 1) / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"format": 99}))
    with pytest.raises(CheckpointError, match="format 99"):
        newest(tmp_path)


class Poison:
    """Unpickled, it writes the file that its tests look for."""

    def __init__(self, canary):
        self.canary = canary

    def __reduce__(self):
        return (open, (str(self.canary), "w"))


def read_all(run):
    found, _ = newest(run)
    return found.saved_config(), found.policy(), found.training()


@pytest.mark.parametrize("name", ["policy.pt", "training.pt", "config.json", "manifest.json"])
@pytest.mark.parametrize("as_archive", [False, True])
def test_a_pickle_in_place_of_any_file_does_not_run(tmp_path, name, as_archive):
    folder, canary = saved(tmp_path, 1), tmp_path / "canary"
    poison = io.BytesIO()
    torch.save({"weight": Poison(canary)}, poison) if as_archive else pickle.dump(Poison(canary), poison)
    (folder / name).write_bytes(poison.getvalue())
    if name != "manifest.json":
        forge(folder)
    with pytest.raises(CheckpointError, match="cannot be read"):
        read_all(tmp_path)
    assert not canary.exists()
    poison.seek(0)
    torch.load(poison, weights_only=False) if as_archive else pickle.load(poison)
    assert canary.exists(), "it works where it is let in"


def told_of_shape(shape):
    """A signature that says all, whose state has a shape."""
    state = {"shape": shape, "dtype": "uint8", "names": [], "symmetry": None}
    plain = {"n_agents": 2, "actions": [], "roles": [], "agencies": [], "is_late": False}
    return {"observation": {}, "state": state, **plain}


FORGED = [
    {"frames": "1"},
    {"frames": True},
    {"mode": "lucky"},
    {"scenario": "\x1b[31mred"},
    {"scenario": ["tiny"]},
    {"files": []},
    {"files": {}},
    {"files": {"policy.pt": {}}},
    {"signature": None},
    {"signature": {}},
    {"signature": told_of_shape(["x"])},
    {"signature": told_of_shape([1e400])},
    {"versions": None, "more": 1},
    {"format": None},
    {"format": [2]},
]


@pytest.mark.parametrize("symmetry", [to_plain(Planes(4)), {"kind": "Planes"}, {"kind": "Sphere"}, 7], ids=str)
def test_a_forged_symmetry_is_refused_in_one_line(tmp_path, symmetry):
    folder = saved(tmp_path, 1)
    signature = json.loads((folder / "manifest.json").read_text())["signature"]
    signature["observation"]["view"]["symmetry"] = to_plain(Planes(3))
    forge(folder, signature=signature)
    assert newest(tmp_path)[0].manifest.signature.observation["view"].symmetry == Planes(3)
    signature["observation"]["view"]["symmetry"] = symmetry
    forge(folder, signature=signature)
    with pytest.raises(CheckpointError, match=r"is not a manifest of format 2$"):
        newest(tmp_path)


@pytest.mark.parametrize("changes", FORGED, ids=str)
def test_a_forged_manifest_is_refused_in_one_line(tmp_path, changes):
    forge(saved(tmp_path, 1), **changes)
    with pytest.raises(CheckpointError) as error:
        newest(tmp_path)
    assert "\n" not in str(error.value)


DEEP = '{"choices": {}, "values": {"a": ' + "[" * 30 + "]" * 30 + "}}"
LONG = '{"choices": {"scenario": "' + "a" * 5000 + '"}, "values": {}}'
NUMBER = '{"choices": {}, "values": {"seed": 1e999}}'


@pytest.mark.parametrize(
    "content", ["{}", "[]", '{"choices": 1, "values": {}}', "[" * 100_000, "\xff", DEEP, LONG, NUMBER]
)
def test_a_forged_configuration_is_refused_in_one_line(tmp_path, content):
    folder = saved(tmp_path, 1)
    (folder / "config.json").write_bytes(content.encode("latin-1"))
    forge(folder)
    with pytest.raises(CheckpointError, match=r"config\.json") as error:
        newest(tmp_path)[0].saved_config()
    assert "\n" not in str(error.value)


def test_a_configuration_that_reads_the_environment_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="must be a plain value"):
        restore(SavedConfig(choices={}, values={"landscape": {"path": "${oc.env:HOME}"}}))


def test_a_manifest_without_its_seal_is_refused(tmp_path):
    folder = saved(tmp_path, 1)
    manifest = json.loads((folder / "manifest.json").read_text())
    del manifest["sha256"]
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(CheckpointError, match="altered"):
        newest(tmp_path)


def test_a_crash_while_saving_leaves_what_was_there(tmp_path, monkeypatch):
    saved(tmp_path, 1)
    calls = {"left": 0}
    real = checkpoints.disk.sync

    def fails(path):
        calls["left"] -= 1
        if calls["left"] < 0:
            raise OSError(28, "No space left on device", str(path))
        real(path)

    monkeypatch.setattr(checkpoints.disk, "sync", fails)
    for allowed in range(5):
        calls["left"] = allowed
        with pytest.raises(OSError, match="No space"):
            saved(tmp_path, 2)
        assert [each.name for each in (tmp_path / "checkpoints").iterdir()] == ["1"]
        assert newest(tmp_path)[0].manifest.frames == 1


def test_a_draft_of_a_killed_save_is_not_a_checkpoint_and_goes_with_the_next(tmp_path):
    shutil.copytree(saved(tmp_path, 1), tmp_path / "checkpoints" / f"{DRAFT}5" / "draft")
    assert newest(tmp_path)[0].manifest.frames == 1
    saved(tmp_path, 2)
    assert sorted(each.name for each in (tmp_path / "checkpoints").iterdir()) == ["1", "2"]


def test_what_somebody_else_removes_meanwhile_is_gone_and_no_error(tmp_path, monkeypatch):
    real = shutil.rmtree

    def after_another(path, **options):
        real(path, ignore_errors=True)
        real(path, **options)

    monkeypatch.setattr(checkpoints.shutil, "rmtree", after_another)
    for frames in (1, 2, 3, 4):
        (tmp_path / "checkpoints" / f"{DRAFT}{frames}").mkdir(parents=True)
        saved(tmp_path, frames, keep=2)
    assert sorted(each.name for each in (tmp_path / "checkpoints").iterdir()) == ["3", "4"]


def test_a_run_that_leaves_its_policy_has_nothing_to_go_on_from(tmp_path):
    for frames in (100, 200, 300):
        saved(tmp_path, frames)
    torn = tmp_path / "checkpoints" / "300" / "policy.pt"
    torn.write_bytes(torn.read_bytes()[:-1])
    for _ in range(2):  # once more changes nothing
        checkpoints.leave_policy(tmp_path)
        assert [each.name for each in (tmp_path / "checkpoints").iterdir()] == ["200"]
        found, _ = newest(tmp_path)
        assert found.policy()["weight"].tolist() == [0, 1, 2, 3] and found.manifest.mode == "sampled"
        with pytest.raises(CheckpointError, match="holds a policy alone"):
            found.training()


def test_a_disk_that_refuses_the_policy_leaves_the_whole_run(tmp_path, monkeypatch):
    for frames in (100, 200):
        saved(tmp_path, frames)

    def refuse(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoints.disk, "replace", refuse)
    with pytest.raises(OSError, match="No space left"):
        checkpoints.leave_policy(tmp_path)
    assert newest(tmp_path)[0].training()["frames"] == 200


def test_a_policy_that_is_left_is_there_whenever_the_power_goes(tmp_path, monkeypatch):
    for frames in (100, 200):
        saved(tmp_path, frames)

    def fail(path, **options):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("pathlib.Path.unlink", fail)  # after the manifest, and before the training state is gone
    with pytest.raises(OSError, match="Input/output"):
        checkpoints.leave_policy(tmp_path)
    monkeypatch.undo()
    assert newest(tmp_path)[0].manifest.frames == 200 and not newest(tmp_path)[1]
    checkpoints.leave_policy(tmp_path)
    assert sorted(each.name for each in (tmp_path / "checkpoints" / "200").iterdir()) == [
        "config.json",
        "manifest.json",
        "policy.pt",
    ]


def test_an_export_appears_when_what_it_holds_was_loaded(tmp_path):
    saved(tmp_path, 1)
    found, seen = newest(tmp_path)[0], []
    export(found, tmp_path / "out" / "made", check=lambda made: seen.append(made.policy()["weight"]))
    assert seen[0].tolist() == newest(tmp_path / "out" / "made")[0].policy()["weight"].tolist() == [0, 1, 2, 3]
    with pytest.raises(CheckpointError, match="holds nan"):
        export(found, tmp_path / "out" / "nan", policy={"weight": torch.tensor([math.nan])})

    def refuse(made):
        raise CheckpointError("no")

    with pytest.raises(CheckpointError, match="no"):
        export(found, tmp_path / "out" / "refused", check=refuse)
    with pytest.raises(FileExistsError):
        export(found, tmp_path / "out" / "made")
    assert [each.name for each in (tmp_path / "out").iterdir()] == ["made"]


def test_who_exports_into_one_folder_at_once_does_not_destroy_the_other_s(tmp_path):
    saved(tmp_path, 1)
    found = newest(tmp_path)[0]

    def one(number):
        try:
            export(found, tmp_path / "made", policy={"weight": torch.full((4,), float(number))})
        except FileExistsError:
            return None
        return number

    with ThreadPoolExecutor(4) as pool:
        (winner,) = (each for each in pool.map(one, range(12)) if each is not None)
    assert newest(tmp_path / "made")[0].policy()["weight"].tolist() == [winner] * 4
    assert sorted(each.name for each in tmp_path.iterdir()) == ["checkpoints", "made"]


@pytest.mark.parametrize("harm", ["link", "pipe", "name"])
def test_a_checkpoint_s_files_are_plain_and_below_it(tmp_path, harm):
    folder = saved(tmp_path, 1)
    path, other = folder / "policy.pt", tmp_path / "other.pt"
    if harm == "name":
        forge(folder, files={"../../other.pt": {"size": 1, "sha256": "0" * 64}})
    else:
        path.rename(other)
        path.symlink_to(other) if harm == "link" else os.mkfifo(path)
    with pytest.raises(CheckpointError, match=r"is a link|is no file|must list"):
        newest(tmp_path)
