"""The forest saved in evaluations in training, by kind of worlds, by hand."""

import pytest

from tests.evaluation.runs.test_curves import the_one_line, write_metrics, write_run
from warp_torchrl.commands.curves import main
from warp_torchrl.evaluation.runs.folders import read_run
from warp_torchrl.evaluation.runs.kinds import last_evaluation


def evaluated(folder, both, windy, calm, **more):
    """Write a run of three rows that was evaluated at its second: 90 % before, nothing after it."""
    columns = {"evaluation__saved": both, "evaluation__saved_windy": windy, "evaluation__saved_calm": calm}
    return write_run(folder, columns={name: [0.9, share, None] for name, share in columns.items()}, **more)


def test_the_last_evaluation_counts(tmp_path):
    run = read_run(evaluated(tmp_path, 0.5, 0.4, 0.6))
    assert last_evaluation(run) == {"all": 0.5, "windy": 0.4, "calm": 0.6}


def test_a_run_of_one_scenario_has_no_kinds(tmp_path):
    run = write_run(tmp_path, columns={"evaluation__saved": [None, 0.25, None]})
    assert last_evaluation(read_run(run)) == {"all": 0.25}


def test_runs_are_compared_with_the_first_of_their_seed(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    for seed, shares in enumerate([(0.5, 0.4, 0.6), (0.6, 0.5, 0.7), (0.7, 0.6, 0.8)]):
        evaluated(tmp_path / "first" / str(seed), *shares, seed=seed)
    for seed, shares in ((2, (0.6, 0.5, 0.7)), (0, (0.8, 0.8, 0.8))):  # 60 - 70 and 80 - 50 points; there is no seed 1
        evaluated(tmp_path / "other" / str(seed), *shares, seed=seed, steps=64)
    write_run(tmp_path / "alone", seed=7, columns={"evaluation__saved": [None, 0.25, None]})
    given = [f"{name}={tmp_path / name}" for name in ("first", "other", "alone")]
    assert main([*given, "--kinds", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-5:] == [
        "| saved in evaluation, % | all | windy | calm | more than the first, seed by seed |",
        "| --- | --- | --- | --- | --- |",
        "| first (3 seeds) | 60.0 | 50.0 | 70.0 |  |",
        "| other (2 seeds) | 70.0 | 65.0 | 75.0 | +30.0, -10.0 |",
        "| alone | 25.0 | - | - |  |",
    ]


def test_runs_whose_seed_is_not_known_are_compared_with_none(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    for name in ("first", "other"):
        write_metrics(tmp_path / name, evaluation__saved=[None, 0.5, None])
    given = [f"{name}={tmp_path / name}" for name in ("first", "other")]
    assert main([*given, "--kinds", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == ["| first | 50.0 |  |", "| other | 50.0 |  |"]


def test_a_run_that_was_not_evaluated_is_told_before_anything_is_drawn(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    run = write_run(tmp_path / "run")
    line = the_one_line(capsys, run, "--out", tmp_path / "out", "--kinds")
    assert line.endswith(f"{run / 'metrics.csv'} has no evaluation in training: evaluation.interval makes them")
    assert not (tmp_path / "out").exists()
