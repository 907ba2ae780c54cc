"""What a fit makes small, on cells in a row."""

import math

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.calibration.losses import jaccard_loss, probability_loss
from warp_torchrl.world.law.travel import NEVER


def test_half_of_the_loss_is_of_the_hours_and_half_of_the_scar_s_area():
    # By 10 minutes one of two cells burns: 1/2. By 20 three of four: 3/4. No fourth cell ever burns: 3/4 at the area.
    arrival = torch.tensor([[[5.0, 15.0, 18.0, NEVER]]])
    burned = torch.stack((drawn("##.."), drawn("####")))
    told = 1.0 - 0.5 * (1 / 2 + 3 / 4) / 2 - 0.5 * 3 / 4
    assert jaccard_loss(arrival, torch.tensor([10.0, 20.0]), burned) == pytest.approx(told)


def test_of_several_fires_a_cell_burns_where_half_of_them_come():
    arrival = torch.tensor([[[5.0, 5.0, NEVER]], [[5.0, NEVER, NEVER]], [[5.0, 9.0, 9.0]], [[NEVER, NEVER, NEVER]]])
    assert jaccard_loss(arrival, torch.tensor([10.0]), drawn("##.")[None]) == pytest.approx(0.0)


def test_probabilities_cost_by_what_happened_over_fuel_for_each_burned_cell():
    probability, fuel = torch.tensor([[[0.8, 0.4, 0.9]], [[0.8, 0.4, 0.9]]]), drawn("##.")
    burned = torch.stack((drawn("#.."), drawn("##.")))
    first, second = -math.log(0.8) - math.log(0.6), (-math.log(0.8) - math.log(0.4)) / 2
    assert float(probability_loss(probability, burned, fuel, "cross_entropy")) == pytest.approx((first + second) / 2)
    first, second = 0.2**2 + 0.4**2, (0.2**2 + 0.6**2) / 2
    assert float(probability_loss(probability, burned, fuel, "brier")) == pytest.approx((first + second) / 2)


def test_no_cell_costs_more_than_a_hundredth_does():
    sure, burned = torch.tensor([[[0.0, 1.0]]]), drawn("#.")[None]
    found = probability_loss(sure, burned, drawn("##"), "cross_entropy")
    assert float(found) == pytest.approx(-2 * math.log(0.01))
