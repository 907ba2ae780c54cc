"""What is written lasts, whole or not at all, and a disk that refuses is told with the path and the reason."""

import errno
import os
from pathlib import Path

import pytest
import torch

from warp_torchrl.runs.metrics_file import MetricsFile
from warp_torchrl.system import disk

FULL = Path("/dev/full")
needs_a_full_disk = pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path):
    (tmp_path / "numbers").write_text("old")
    disk.replace(tmp_path / "numbers", "new\r\nlines")
    assert (tmp_path / "numbers").read_bytes() == b"new\r\nlines" and len(list(tmp_path.iterdir())) == 1


def test_the_old_file_stays_where_the_new_one_fails(tmp_path, monkeypatch):
    (tmp_path / "numbers").write_text("old")

    def refuse(descriptor):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="Input/output error") as error:
        disk.replace(tmp_path / "numbers", "new")
    assert error.value.filename == str(tmp_path / "numbers")
    assert (tmp_path / "numbers").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


@needs_a_full_disk
@pytest.mark.parametrize("size", [1, 10, 100_000, 1_000_000])
def test_tensors_on_a_full_disk_tell_the_path_and_the_reason(tmp_path, size):
    (tmp_path / "policy.pt").symlink_to(FULL)
    with pytest.raises(OSError, match="No space left on device") as error:
        disk.save_tensors(tmp_path / "policy.pt", {"weight": torch.zeros(size)})
    assert error.value.errno == errno.ENOSPC and error.value.filename == str(tmp_path / "policy.pt")


def test_what_torch_cannot_save_is_not_the_disk_s_fault(tmp_path):
    with pytest.raises(Exception, match="pickle") as error:
        disk.save_tensors(tmp_path / "policy.pt", {"weight": lambda: None})
    assert not isinstance(error.value, OSError)


@needs_a_full_disk
def test_a_row_of_metrics_on_a_full_disk_tells_the_path_and_the_reason(tmp_path):
    (tmp_path / "metrics.csv").symlink_to(FULL)
    with pytest.raises(OSError, match="No space left on device") as error:
        MetricsFile(tmp_path / "metrics.csv").add({"a": 1})
    assert error.value.filename == str(tmp_path / "metrics.csv")


def test_drafts_of_one_file_are_apart_and_the_last_stays(tmp_path):
    path = tmp_path / "a.npz"
    with disk.drafted(path) as mine, disk.drafted(path) as yours:
        assert mine != yours and mine.suffix == yours.suffix == ".npz" and mine.parent == tmp_path
        mine.write_text("mine")
        yours.write_text("yours")
        assert not path.exists()
    assert path.read_text() == "mine" and [each.name for each in tmp_path.iterdir()] == ["a.npz"]


def test_a_draft_that_fails_leaves_the_file_and_is_told_by_its_name(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("before")
    with pytest.raises(OSError, match="No such file") as raised, disk.drafted(path) as draft:
        draft.write_text("half")
        draft.unlink()
    assert raised.value.filename == str(path)
    with pytest.raises(ZeroDivisionError), disk.drafted(path) as draft:
        draft.write_text(str(1 / 0))
    assert path.read_text() == "before" and len(list(tmp_path.iterdir())) == 1
