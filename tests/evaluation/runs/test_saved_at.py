"""The forest saved in training by world steps, by hand."""

import math

import pytest

from tests.evaluation.runs.test_curves import the_one_line, write_metrics, write_run
from warp_torchrl.commands.curves import main
from warp_torchrl.evaluation.runs.folders import read_run
from warp_torchrl.evaluation.runs.saved_at import minutes, saved_at, speed

FRAMES = range(100, 6100, 100)  # a twentieth: 300 world steps, three batches
SAVED = [*[0.1] * 10, 0.2, 0.4, *[0.6] * 47, 0.9]  # of 100 .. 1000, 1100, 1200, 1300 .. 5900, 6000


@pytest.fixture
def run(tmp_path):
    return write_run(tmp_path / "run", frames=FRAMES, columns={"world__saved": SAVED})


@pytest.mark.parametrize(
    ("step", "share"),
    [
        (100, 0.1),  # the first batch alone
        (1100, (0.1 + 0.1 + 0.2) / 3),  # of 900, 1000, 1100; what ends at 800 is a twentieth before and not in it
        (1199, (0.1 + 0.1 + 0.2) / 3),
        (1200, (0.1 + 0.2 + 0.4) / 3),
        (6000, (0.6 + 0.6 + 0.9) / 3),
    ],
)
def test_it_is_the_mean_over_the_twentieth_of_the_run_before_a_step(run, step, share):
    assert saved_at(read_run(run), step) == pytest.approx(share, abs=1e-12)


def test_batches_without_an_ended_episode_do_not_count(tmp_path):
    run = write_run(
        tmp_path / "run", frames=FRAMES, columns={"world__saved": [None, None, 0.2, None, 0.4, *[0.5] * 55]}
    )
    assert saved_at(read_run(run), 500) == pytest.approx(0.3, abs=1e-12)  # of 300 and 500
    assert math.isnan(saved_at(read_run(run), 200)), "there is none"


def test_every_row_counts_where_curves_are_means_over_bins(tmp_path):
    frames = range(10, 9010, 10)  # 900 rows: bins of three, whose last stands at 8990
    run = read_run(write_run(tmp_path / "run", frames=frames, columns={"world__saved": [0.5] * 899 + [0.95]}))
    assert run.rows_per_bin == 3
    assert saved_at(run, 9000) == pytest.approx((44 * 0.5 + 0.95) / 45, abs=1e-12)  # of 8560 .. 9000


def test_speed_is_a_median(tmp_path):
    fast = write_run(tmp_path / "run", frames=range(100, 600, 100), columns={"time__fps": [9, None, 400, 500, 600]})
    assert speed(read_run(fast)) == 450  # the slow start moves it little
    assert math.isnan(speed(read_run(write_run(tmp_path / "none"))))


def test_minutes_are_those_of_the_last_batch(tmp_path):
    run = write_run(tmp_path / "run", frames=(100, 200, 300), columns={"time__seconds": [9, 60, 150]})
    assert minutes(read_run(run)) == 2.5
    (run / "metrics.csv").write_text("time/frames,world/saved\n100,0.5\n")
    assert math.isnan(minutes(read_run(run)))


def test_seeds_are_one_row_with_the_lowest_and_the_highest(run, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    columns = {"world__saved": [*[0.2] * 58, 0.6, 0.6], "time__fps": [2000] * 60}
    other = write_run(tmp_path / "other", seed=1, frames=FRAMES, columns=columns)
    alone = write_run(
        tmp_path / "alone", frames=FRAMES, steps=64, columns=columns | {"world__saved": [None] + [1] * 59}
    )
    given = [f"now={run}", f"now={other}", f"then={alone}", "--out", str(tmp_path), "--at", "100,1e3,6000"]
    assert main([*given]) == 0
    # At 6000: (0.6 + 0.6 + 0.9) / 3 = 70.0 % and (0.2 + 0.6 + 0.6) / 3 = 46.7 %, 58.3 % in the mean. One has no fps.
    assert capsys.readouterr().out.splitlines()[-4:] == [
        "| saved in training, % | 0.1 k | 1 k | 6 k | steps/s | minutes |",
        "| --- | --- | --- | --- | --- | --- |",
        "| now (2 seeds) | 15.0 (10.0 .. 20.0) | 15.0 (10.0 .. 20.0) | 58.3 (46.7 .. 70.0) | 2000 (2000 .. 2000) | "
        "10.0 (10.0 .. 10.0) |",
        "| then | - | 100.0 | 100.0 | 2000 | 10.0 |",
    ]


def test_both_tables_may_be_asked_for(run, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert main([str(run), "--out", str(tmp_path), "--reach", "50", "--at", "6000"]) == 0
    *_, reached, between, _, _, saved = capsys.readouterr().out.splitlines()
    assert reached.startswith("| mappo | 1 k, ") and between == "" and saved == "| mappo | 70.0 | - | 10.0 |"


@pytest.mark.parametrize("given", ["soon", "100,", "0", "-5", "10.5", "nan", "inf"])
def test_what_are_no_world_steps_is_told(run, capsys, given):
    with pytest.raises(SystemExit):
        main([str(run), f"--at={given}"])
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.endswith(f"at: must be world steps, whole numbers from 1 on, got {given}")


def test_a_run_that_cannot_say_is_told_before_anything_is_drawn(run, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    out = ("--out", tmp_path / "out")
    line = the_one_line(capsys, run, *out, "--at", "100,6001")
    assert line == f"error: at must be within the run, 6000 world steps of {run}, got 6001"
    bare = write_metrics(tmp_path / "bare", train__loss=(1, 2, 3))
    assert the_one_line(capsys, bare, *out, "--at", "1000").endswith(
        f"{bare / 'metrics.csv'} has no column world/saved"
    )
    (tmp_path / "empty").mkdir()
    assert "holds no metrics.csv" in the_one_line(capsys, tmp_path / "empty", *out, "--at", "1000")
    assert not (tmp_path / "out").exists()
