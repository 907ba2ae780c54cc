"""Results of runs for marl-eval and rliable, and curves over seeds."""

import csv
import json

import numpy as np
import pytest

from tests.evaluation.test_summary import write
from warp_torchrl.evaluation.exports import curves, marl_eval, rliable, seed_bands
from warp_torchrl.evaluation.rows import read_rows
from warp_torchrl.evaluation.summary import main
from warp_torchrl.world.mechanics.mechanic import Metric


def trained(folder, saved, evaluated, **options):
    """A run of three batches of 100 steps, evaluated after the second and the third."""
    write(folder, "mappo", saved, configuration="aaaaaaaa", **options)
    rows = zip((100, 200, 300), (0.1, 0.2, 0.3), ("", *evaluated))
    with (folder / "metrics.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("time/frames", "world/saved", "evaluation/saved"), *rows])


@pytest.fixture
def runs(tmp_path):
    trained(tmp_path / "0", [0.5, 0.7], (0.2, 0.6))
    trained(tmp_path / "1", [0.7, 0.9], (0.4, 0.8))
    trained(tmp_path / "2", [0.1, 0.3], (0.1, 0.2), scenario="other")
    write(tmp_path / "3", "local", [0.5, 0.6])
    return tmp_path


def test_marl_eval_gets_every_seed_s_steps_and_its_last_episodes(runs):
    tasks = marl_eval(read_rows(runs))["warp_torchrl"]
    assert tasks["tiny"]["mappo"]["seed_1"] == {
        "step_0": {"step_count": 200, "saved": [0.4]},
        "step_1": {"step_count": 300, "saved": [0.8]},
        "absolute_metrics": {"saved": [0.7, 0.9], "success": [1.0, 1.0]},
    }
    assert tasks["tiny"]["local"]["seed_0"]["step_1"] == {"step_count": 300, "saved": [0.5, 0.6]}, "a baseline is flat"
    assert {task: {policy: len(each) for policy, each in found.items()} for task, found in tasks.items()} == {
        "tiny": {"mappo": 2, "local": 1},
        "other": {"mappo": 1},
    }


def test_rliable_gets_scores_by_run_and_task_of_policies_that_have_all(runs):
    found = rliable(read_rows(runs))
    assert found["tasks"] == ["tiny", "other"] and list(found["scores"]) == ["mappo"]
    assert np.allclose(found["scores"]["mappo"], [[0.6, 0.2]]), "one run of each task"
    assert found["frames"] == [200, 300] and found["curves"] == {"mappo": [[[0.2, 0.6], [0.1, 0.2]]]}
    with pytest.raises(ValueError, match="no policy was evaluated on all of other, tiny"):
        rliable([entry for entry in read_rows(runs) if (entry.scenario == "tiny") == (entry.policy == "local")])


def test_a_goal_that_no_training_logs_has_no_curves_and_less_of_it_is_a_higher_score(runs):
    entries = [each._replace(goal=Metric("escaped", "less")) for each in read_rows(runs)]
    found = rliable(entries)
    assert np.allclose(found["scores"]["mappo"], [[-0.6, -0.2]]) and found["frames"] == [] and found["curves"] == {}
    logged = [each._replace(goal=Metric("saved", "less")) for each in read_rows(runs)]
    assert rliable(logged)["curves"] == {"mappo": [[[-0.2, -0.6], [-0.1, -0.2]]]}
    assert marl_eval(entries)["warp_torchrl"]["tiny"]["mappo"]["seed_1"] == {
        "step_0": {"step_count": 0, "escaped": [0.7, 0.9]},
        "absolute_metrics": {"escaped": [0.7, 0.9], "success": [1.0, 1.0]},
    }


def test_a_curve_has_the_interval_of_its_mean_over_seeds(runs):
    steps, mean, low, high = seed_bands(read_rows(runs)[0])
    assert steps.tolist() == [200, 300] and np.allclose(mean, [0.3, 0.7])
    # Two seeds are resampled: both are the lower one in a quarter of the samples, both the higher one in a quarter.
    assert np.allclose(low, [0.2, 0.6]) and np.allclose(high, [0.4, 0.8])


def test_a_curve_is_of_training_where_nothing_was_evaluated_on_the_way(tmp_path):
    trained(tmp_path / "0", [0.5, 0.7], ("", ""))
    steps, values = curves(read_rows(tmp_path)[0])
    assert steps.tolist() == [100, 200, 300] and values.tolist() == [[0.1, 0.2, 0.3]]


def test_the_command_writes_what_it_is_given_a_file_for(runs, capsys):
    pytest.importorskip("matplotlib", reason="curves are drawn with Matplotlib (extra figures)")
    files = {
        flag: runs / f"{flag}.{end}" for flag, end in (("marl-eval", "json"), ("rliable", "json"), ("curves", "png"))
    }
    main([str(runs), *(word for flag, path in files.items() for word in (f"--{flag}", str(path)))])
    assert json.loads(files["marl-eval"].read_text()) == marl_eval(read_rows(runs))
    assert json.loads(files["rliable"].read_text())["tasks"] == ["tiny", "other"]
    assert files["curves"].read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(SystemExit):
        main([str(runs / "3"), "--curves", str(runs / "none.png")])
    assert "curves: no run has a metrics.csv with what its policies are compared by" in capsys.readouterr().err
