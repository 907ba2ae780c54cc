"""metrics.csv is complete, also after a crash and a resume."""

import csv
import os

import pytest

from warp_torchrl.runs.metrics_file import FRAMES, MetricsFile


def lines(path):
    with path.open(newline="") as file:
        return list(csv.reader(file))


def test_rows_are_appended_and_holes_left_empty(tmp_path):
    metrics = MetricsFile(tmp_path / "metrics.csv")
    metrics.add({"a": 1, "b": 0.1 + 0.2})
    metrics.add({"a": 2, "b": None})
    assert lines(tmp_path / "metrics.csv") == [["a", "b"], ["1", "0.30000000000000004"], ["2", ""]]
    with pytest.raises(ValueError, match="no columns"):
        metrics.add({"c": 1})


def test_a_resumed_file_is_cut_back_to_the_checkpoint(tmp_path):
    metrics = MetricsFile(tmp_path / "metrics.csv")
    for number in range(4):
        metrics.add({FRAMES: number})
    resumed = MetricsFile(tmp_path / "metrics.csv", keep_rows=2)
    resumed.add({FRAMES: 9})
    assert lines(tmp_path / "metrics.csv") == [[FRAMES], ["0"], ["1"], ["9"]] and resumed.rows == 3


def test_the_first_row_of_a_resumed_run_may_add_columns(tmp_path):
    MetricsFile(tmp_path / "metrics.csv").add({FRAMES: 0, "a": 1})
    resumed = MetricsFile(tmp_path / "metrics.csv", keep_rows=1)
    resumed.add({FRAMES: 1, "new": 5, "a": None})
    resumed.add({FRAMES: 2, "a": 3})
    assert lines(tmp_path / "metrics.csv") == [[FRAMES, "a", "new"], ["0", "1", ""], ["1", "", "5"], ["2", "3", ""]]
    with pytest.raises(ValueError, match=r"no columns \['late'\]"):
        resumed.add({FRAMES: 3, "late": 1})


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (os.mkfifo, "is no file"),
        (lambda path: path.symlink_to("/dev/zero"), "is no file"),
        (lambda path: path.touch() or os.truncate(path, 2**40), "is too large"),
        (lambda path: path.write_bytes(bytes(200_000)), "is no table of metrics: field larger than field limit"),
        (lambda path: path.write_text("a,b\n1,2\n3,4\n"), "is no table of metrics: it has no column time/frames"),
    ],
    ids=["pipe", "device", "holes", "zeros", "another table"],
)
def test_a_resumed_file_that_is_none_is_refused(tmp_path, make, told):
    make(tmp_path / "metrics.csv")
    with pytest.raises(ValueError, match=told):
        MetricsFile(tmp_path / "metrics.csv", keep_rows=1)


def test_a_new_run_starts_a_new_file(tmp_path):
    (tmp_path / "metrics.csv").write_text("old,columns\n1,2\n")
    MetricsFile(tmp_path / "metrics.csv").add({"a": 1})
    assert lines(tmp_path / "metrics.csv") == [["a"], ["1"]]


def test_the_frames_of_the_last_row_that_is_cut_are_known(tmp_path):
    path = tmp_path / "metrics.csv"
    path.write_text("time/frames,a\n32,1\n64,2\n96,3\n12")  # a crash has cut the last row
    assert MetricsFile(path, keep_rows=1).cut_at == 96
    assert MetricsFile(path, keep_rows=1).cut_at == 0
