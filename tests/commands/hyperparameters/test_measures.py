"""What a search reads of a training that is being trained."""

import json
import os

import pytest

from warp_torchrl.commands.hyperparameters.measures import goal_at_the_end, goal_by_share, goal_in_evaluation


def metrics(path, *rows, end="\n"):
    path.write_text("time/frames,train/loss,world/saved\n" + "\n".join(f"{f},0.5,{saved}" for f, saved in rows) + end)
    return path


def test_a_step_is_the_mean_of_its_rows_and_without_any_that_of_the_one_before(tmp_path):
    path = metrics(tmp_path / "metrics.csv", (40, ""), (80, 0.2), (100, 0.4), (150, 0.5), (300, 0.9))
    # Of 1000 frames a step has 50: (50, 100] has 0.2 and 0.4, (100, 150] 0.5, (150, 250] nothing, (250, 300] 0.9.
    expected = {10: 0.3, 15: 0.5, 20: 0.5, 25: 0.5, 30: 0.9}
    assert goal_by_share(path, 1000, "saved") == pytest.approx(expected)


def test_a_last_batch_that_goes_beyond_the_total_belongs_to_the_last_step(tmp_path):
    path = metrics(tmp_path / "metrics.csv", (960, 0.4), (1024, 0.8))
    assert goal_by_share(path, 1000, "saved") == pytest.approx({100: 0.6})


def test_a_row_that_is_being_written_is_not_read(tmp_path):
    path = metrics(tmp_path / "metrics.csv", (50, 0.2), (100, 0.9), end="")
    assert goal_by_share(path, 1000, "saved") == {5: 0.2}
    assert goal_by_share(tmp_path / "none.csv", 1000, "saved") == {}


def test_the_end_is_the_last_fifth(tmp_path):
    path = metrics(tmp_path / "metrics.csv", (800, 0.1), (900, 0.4), (950, ""), (1000, 0.6))
    assert goal_at_the_end(path, 1000, "saved") == pytest.approx(0.5)
    assert goal_at_the_end(path, 2000, "saved") is None


@pytest.mark.parametrize("content", ["{", "[]", "{}", json.dumps({"metrics": {"saved": {"mean": None}}})])
def test_an_evaluation_that_says_nothing_has_no_value(tmp_path, content):
    (tmp_path / "evaluation.json").write_text(content)
    assert goal_in_evaluation(tmp_path / "evaluation.json", "saved") is None
    assert goal_in_evaluation(tmp_path / "not there.json", "saved") is None


def test_an_evaluation_has_the_mean_of_its_fires(tmp_path):
    (tmp_path / "evaluation.json").write_text(json.dumps({"metrics": {"saved": {"mean": 0.5}}}))
    assert goal_in_evaluation(tmp_path / "evaluation.json", "saved") == 0.5


def test_another_goal_has_its_own_column(tmp_path):
    (tmp_path / "metrics.csv").write_text("time/frames,world/saved,world/escaped\n50,0.2,0.9\n100,0.4,0.7\n")
    assert goal_by_share(tmp_path / "metrics.csv", 100, "escaped")[100] == 0.7
    assert goal_at_the_end(tmp_path / "metrics.csv", 100, "escaped") == 0.7


@pytest.mark.parametrize("mean", [10**400, "0.5", True, [0.5], None, {"a": 1}])
def test_an_evaluation_without_a_number_is_none(tmp_path, mean):
    (tmp_path / "evaluation.json").write_text(json.dumps({"metrics": {"saved": {"mean": mean}}}))
    assert goal_in_evaluation(tmp_path / "evaluation.json", "saved") is None


def test_rows_that_are_none_are_left_out(tmp_path):
    path = tmp_path / "metrics.csv"
    long = "9" * 200_000  # more than a cell may have
    path.write_text(f"time/frames,world/saved\n10,0.5\n{long},1\nnan,1\ninf,1\n\0,1\n20\n20,0.7\n")
    assert goal_by_share(path, 20, "saved") == pytest.approx({5 * n: 0.5 for n in range(10, 20)} | {100: 0.7})
    path.unlink()
    os.mkfifo(path)
    assert goal_by_share(path, 20, "saved") == {}
