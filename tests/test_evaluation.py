"""Statistics by hand, and pairing."""

import json

import numpy as np
import pytest
import torch

from warp_torchrl.evaluation import compare, interquartile_mean, play, report, summarise, table, write_json
from warp_torchrl.heuristics import NoOp, Random


def test_the_interquartile_mean_is_that_of_the_middle_half():
    assert interquartile_mean(np.array([100.0, 1, 2, 3, 4, 5, 6, -50])) == pytest.approx(3.5)  # 2, 3, 4, 5
    scipy = pytest.importorskip("scipy.stats")
    values = np.random.default_rng(1).normal(size=101)
    assert interquartile_mean(values) == pytest.approx(scipy.trim_mean(values, 0.25))


def test_intervals_cover_the_mean_as_often_as_they_say():
    """100 samples of 64 normals; a 95 % interval misses 5 on average, more than 13 with probability 4e-4."""
    draws = np.random.default_rng(2).normal(size=(100, 64))
    misses = 0
    for values in draws:
        low, high = summarise({"saved": values})["saved"]["ci95"]
        misses += not low <= 0.0 <= high
    assert 1 <= misses <= 13


def test_a_paired_difference_is_narrower_than_its_parts():
    luck = np.random.default_rng(3).uniform(size=200)
    better = compare({"saved": luck + 0.05}, {"saved": luck})
    assert better["saved_difference"] == pytest.approx(0.05) and better["ci95"] == pytest.approx([0.05, 0.05])


def test_policies_meet_the_same_worlds_and_the_generator_is_left_alone(make_small_env):
    env = make_small_env(3)
    before = torch.get_rng_state()
    first, again = play(env, NoOp(env), 70), play(env, NoOp(env), 70)
    play(env, Random(env), 70)
    assert (first["saved"] == again["saved"]).all() and (torch.get_rng_state() == before).all()


def test_every_world_is_played_to_its_own_end(make_small_env):
    env = make_small_env(4)
    episodes = play(env, NoOp(env), 5)
    assert env.world_state.done.all()
    assert ((episodes["control_time"] == 1.0) | (episodes["burning"] == 0.0)).all()


def test_the_report_has_what_the_contract_says(make_small_env, tmp_path):
    env = make_small_env(3)
    mine, noop = play(env, Random(env), 9), play(env, NoOp(env), 9)
    content = report("tiny", "random", 9, mine, {"noop": noop})
    write_json(tmp_path / "evaluation.json", content)
    read = json.loads((tmp_path / "evaluation.json").read_text())
    assert read["seeds"] == [9, 10, 11] and read["scenario"] == "tiny" and read["policy"] == "random"
    assert set(read["metrics"]["saved"]) >= {"iqm", "mean", "ci95"}
    assert read["episodes"][1]["seed"] == 10 and 0.0 <= read["episodes"][1]["saved"] <= 1.0
    assert set(read["versus"]["noop"]) == {"saved_difference", "ci95"}
    assert "random - noop" in table(read) and "tiny: 3 fires" in table(read)
