"""Scores of probabilities and of areas, in numbers worked out by hand."""

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores.probabilities import arrival_crps, brier, crps, interval


def test_the_brier_score_is_one_where_nothing_is_predicted_and_leaves_out_other_cells():
    burned, chance = drawn("##.."), torch.tensor([[0.5, 1.0, 0.5, 0.0]])
    assert float(brier(torch.zeros(1, 4), burned)) == 1.0
    assert float(brier(chance, burned)) == pytest.approx((0.25 + 0.25) / 2)
    assert float(brier(chance, burned, drawn("##.#"))) == pytest.approx(0.25 / 2)


def test_the_crps_of_one_value_is_its_distance_and_of_two_less():
    assert crps(torch.tensor([3.0]), 5.0) == 2.0
    # |4 - 5| and |6 - 5|, mean 1; of pairs 0, 2, 2, 0, half of their mean 0.5
    assert crps(torch.tensor([4.0, 6.0]), 5.0) == pytest.approx(0.5)


def test_the_crps_of_arrival_is_the_time_by_which_one_fire_is_off():
    # It comes at 30 of 60 minutes, the fire came at 10: wrong at the ends of the steps 1 and 2 of 6 steps
    steps = torch.arange(1.0, 7.0)[:, None, None] * 10.0
    reached = (steps >= 30.0).float().expand(-1, 1, 1)
    assert arrival_crps(reached, torch.tensor([[10.0]]), 60.0, drawn("#")) == pytest.approx(20.0)


def test_the_interval_has_nine_tenths():
    assert interval(torch.arange(101.0)) == (5.0, 95.0)
