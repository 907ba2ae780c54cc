"""The loss that gradients go down: the mean of the fires, and the prior."""

import pytest
import torch

from tests.calibration.ground import case_of, fire
from warp_torchrl.calibration.gradients import Gradients
from warp_torchrl.calibration.parameters import parameters_of


def test_the_prior_adds_half_a_square_to_the_mean_loss_its_place_to_the_gradient_and_one_to_the_curvature():
    start, z = fire(), torch.tensor([0.5, -1.0])
    case = case_of(fire(rate_gain=1.4), side=13, turned=0.0)
    parameters = parameters_of(["rate_gain", "wind_gain"], start)
    loss, gradient, curvature = Gradients(prior_weight=0.0).slope(start, parameters, z, [case])
    with_prior = Gradients(prior_weight=0.4).slope(start, parameters, z, [case, case])
    assert with_prior[0] == pytest.approx(loss + 0.4 * 0.5 * (0.25 + 1.0))
    assert torch.allclose(with_prior[1], gradient + torch.tensor([0.2, -0.4]))
    assert torch.allclose(with_prior[2], curvature + 0.4 * torch.eye(2), atol=1e-5)
