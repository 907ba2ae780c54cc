"""Checkpoints are complete or invisible, and verified before they are read."""

import json
import shutil

import pytest
import torch

from warp_torchrl import checkpoint as checkpoints
from warp_torchrl.checkpoint import CheckpointError, RunFolderInUse, RunFolderLock, newest
from warp_torchrl.config import Record
from warp_torchrl.models import Entry, Signature

SIGNATURE = Signature({"view": Entry((3, 5, 5), "uint8")}, Entry((9, 16, 16), "float32"), 2, 11, 2)


def saved(run, frames, keep=3):
    return checkpoints.save(
        run,
        frames=frames,
        scenario="tiny",
        signature=SIGNATURE,
        mode="sampled",
        record=Record(choices={"algorithm": "mappo"}, values={"seed": 3}),
        policy={"weight": torch.arange(4.0)},
        training={"frames": frames, "random": torch.get_rng_state()},
        keep=keep,
    )


def test_what_was_saved_comes_back(tmp_path):
    saved(tmp_path, 100)
    found, skipped = newest(tmp_path)
    assert not skipped and found.manifest.frames == 100 and found.manifest.signature == SIGNATURE
    assert found.policy()["weight"].tolist() == [0, 1, 2, 3] and found.training()["frames"] == 100
    assert found.record() == Record(choices={"algorithm": "mappo"}, values={"seed": 3})


def test_the_newest_is_found_by_number_and_old_ones_go(tmp_path):
    for frames in (900, 1000, 20, 99_999):
        saved(tmp_path, frames, keep=3)
    assert newest(tmp_path)[0].manifest.frames == 99_999
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [900, 1000, 99_999]
    assert newest(tmp_path / "checkpoints" / "900")[0].manifest.frames == 900


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
    found, skipped = newest(tmp_path)
    assert found.manifest.frames == 1 or (name == "manifest.json" and _same_meaning(found))
    if found.manifest.frames == 1:
        assert len(skipped) == 1 and "\n" not in skipped[0] and "2" in skipped[0]


def _same_meaning(found):
    """A flipped bit in the manifest may fall on white space or on a version's name and change nothing that is used."""
    return found.manifest.signature == SIGNATURE and found.policy()["weight"].tolist() == [0, 1, 2, 3]


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


def test_a_pickle_in_place_of_weights_does_not_run(tmp_path):
    import hashlib
    import pickle

    class Poison:
        def __reduce__(self):
            return (open, (str(tmp_path / "canary"), "w"))

    folder = saved(tmp_path, 1)
    poison = pickle.dumps(Poison())
    (folder / "policy.pt").write_bytes(poison)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"]["policy.pt"] = {"size": len(poison), "sha256": hashlib.sha256(poison).hexdigest()}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    found, _ = newest(tmp_path)
    with pytest.raises(CheckpointError, match="cannot be read"):
        found.policy()
    assert not (tmp_path / "canary").exists()


def test_a_crash_while_saving_leaves_what_was_there(tmp_path, monkeypatch):
    saved(tmp_path, 1)
    calls = {"left": 0}
    real = checkpoints._sync

    def fails(path):
        calls["left"] -= 1
        if calls["left"] < 0:
            raise OSError(28, "No space left on device", str(path))
        real(path)

    monkeypatch.setattr(checkpoints, "_sync", fails)
    for allowed in range(5):
        calls["left"] = allowed
        with pytest.raises(OSError, match="No space"):
            saved(tmp_path, 2)
        assert [each.name for each in (tmp_path / "checkpoints").iterdir()] == ["1"]
        assert newest(tmp_path)[0].manifest.frames == 1


def test_a_draft_of_a_killed_run_is_not_a_checkpoint(tmp_path):
    shutil.copytree(saved(tmp_path, 1), tmp_path / "checkpoints" / ".5.77.tmp")
    assert newest(tmp_path)[0].manifest.frames == 1


def test_a_run_folder_has_one_writer(tmp_path):
    lock = RunFolderLock(tmp_path / "run")
    with pytest.raises(RunFolderInUse, match="in use"):
        RunFolderLock(tmp_path / "run")
    lock.release()
    RunFolderLock(tmp_path / "run").release()
