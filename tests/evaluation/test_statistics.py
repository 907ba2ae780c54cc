"""Statistics by hand."""

import numpy as np
import pytest

from warp_torchrl.evaluation.statistics import compare, interquartile_mean, interval, performance_profile, summarise


def test_the_interquartile_mean_is_that_of_the_middle_half():
    assert interquartile_mean(np.array([100.0, 1, 2, 3, 4, 5, 6, -50])) == pytest.approx(3.5)  # 2, 3, 4, 5
    assert interquartile_mean(np.array([[100.0, 1, 2, -50], [0, 10, 20, 30], [7, 7, 7, 7]])).tolist() == [
        1.5,
        15.0,
        7.0,
    ]
    scipy = pytest.importorskip("scipy.stats")
    values = np.random.default_rng(1).normal(size=101)
    assert interquartile_mean(values) == pytest.approx(scipy.trim_mean(values, 0.25))


def test_intervals_cover_the_mean_as_often_as_they_say():
    """100 samples of 64 normals; a 95 % interval misses 5 on average, more than 13 with probability 4e-4."""
    draws = np.random.default_rng(2).normal(size=(100, 64))
    misses = 0
    for values in draws:
        low, high = summarise(values)["ci95"]
        misses += not low <= 0.0 <= high
    assert 1 <= misses <= 13


def test_an_interval_leaves_two_and_a_half_percent_out_on_either_side():
    """The mean of 400 normals lies 1.96 standard errors from either end; 1.64 would be 90 %, 1.81 leaves 3.5 % out.

    A bound of 4000 resamples is known to 0.04 standard errors.
    """
    values = np.random.default_rng(5).normal(size=400)
    bounds = (np.array(summarise(values)["ci95"]) - values.mean()) / (values.std() / 20.0)
    assert bounds == pytest.approx([-1.96, 1.96], abs=0.1)


def test_published_intervals_come_again():
    # The resamples are those of one seed: what an evaluation printed, any other prints of the same episodes.
    values = np.random.default_rng(6).uniform(size=32)
    found = summarise(values)
    assert [round(bound, 6) for bound in found["ci95"]] == [0.373842, 0.576891]
    assert summarise(values) == found


def test_a_paired_difference_is_narrower_than_its_parts():
    luck = np.random.default_rng(3).uniform(size=200)
    better = compare(luck + 0.05, luck)
    assert better["saved_difference"] == pytest.approx(0.05) and better["ci95"] == pytest.approx([0.05, 0.05])


def test_the_probability_of_improvement_by_hand():
    # Better on two worlds, equal on one, worse on one: (1 + 1 + 0.5 + 0) / 4.
    found = compare(np.array([0.5, 0.6, 0.7, 0.1]), np.array([0.4, 0.5, 0.7, 0.2]))
    assert found["probability_of_improvement"] == pytest.approx(0.625)
    assert found["saved_difference"] == pytest.approx(0.025)
    low, high = found["probability_ci95"]
    assert 0.0 <= low <= 0.625 <= high <= 1.0


def test_every_run_is_compared_with_every_run():
    # Two runs against two: on the one world 0.5 and 0.7 against 0.6 and 0.4: lost, won, won, won.
    found = compare(np.array([[0.5], [0.7]]), np.array([[0.6], [0.4]]))
    assert found["probability_of_improvement"] == pytest.approx(0.75)
    assert found["saved_difference"] == pytest.approx(0.1)


def test_an_interval_of_improvement_resamples_the_runs_of_the_policy():
    # Of two runs one always saves more than the other policy's only run and one never: the mean of two draws of them
    # is 0, 1/2 or 1.
    found = compare(np.repeat([[0.1], [0.9]], 50, axis=1), np.full((1, 50), 0.5))
    assert found["probability_of_improvement"] == 0.5 and found["probability_ci95"] == [0.0, 1.0]


def test_several_runs_are_resampled_as_runs():
    # Two runs that differ by 0.4 on every world: the mean of two draws of them is 0.3, 0.5 or 0.7.
    values = np.repeat([[0.3], [0.7]], 50, axis=1)
    low, high = summarise(values)["ci95"]
    assert (low, high) == pytest.approx((0.3, 0.7))
    assert summarise(values.reshape(-1))["ci95"][0] > 0.4  # as if they were independent episodes


def test_runs_share_the_worlds_that_are_resampled():
    # Runs that agree on each world are no more evidence than one of them.
    world = np.random.default_rng(4).uniform(size=60)
    one, five = interval(world, lambda x: x.mean(-1)), interval(np.tile(world, (5, 1)), lambda x: x.mean(-1))
    assert five[1] - five[0] == pytest.approx(one[1] - one[0], rel=0.1)


def test_a_missing_number_is_left_out():
    assert summarise(np.array([np.nan, 1.0, 3.0]))["mean"] == pytest.approx(2.0)
    assert summarise(np.array([np.nan, np.nan])) == {"iqm": None, "mean": None, "ci95": None, "iqm_ci95": None}


def test_a_performance_profile_falls_from_all_to_none():
    values = np.array([0.1, 0.4, 0.4, 0.9])
    assert performance_profile(values, np.array([0.0, 0.2, 0.4, 0.5, 1.0])).tolist() == [1.0, 0.75, 0.75, 0.25, 0.0]
