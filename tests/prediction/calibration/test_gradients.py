"""The loss that gradients go down: the mean of the fires, and the prior."""

from statistics import NormalDist
from types import SimpleNamespace

import pytest
import torch

from tests.prediction.calibration.ground import drawn, fire
from warp_torchrl.prediction.calibration.expected import Margin
from warp_torchrl.prediction.calibration.gradients import Gradients

FACTORS = {"a": torch.tensor([[[-0.1, 0.2, 0.0]]]), "b": torch.tensor([[[0.3, 0.1, -0.2]]])}
SLOPES = torch.tensor([[[[1.0, 0.5, 2.0]]], [[[0.0, -1.0, 0.3]]]])


@pytest.fixture
def slope(monkeypatch):
    """The slope at some z of two parameters for fires of three cells whose margins are given."""

    def told(fire, parameters, z, case):
        return Margin(FACTORS[case.name].clone(), SLOPES, drawn("###"))

    monkeypatch.setattr("warp_torchrl.prediction.calibration.gradients.margin", told)
    burned = drawn("#.#")[None]

    def of(names, z, **options):
        cases = [SimpleNamespace(name=name, burned=burned) for name in names]
        return Gradients(**options).slope(fire(), (), torch.tensor(z), cases)

    return of


def test_the_prior_adds_half_a_square_to_the_loss_its_place_to_the_gradient_and_one_to_the_curvature(slope):
    z = [0.5, -1.0]
    loss, gradient, curvature = slope("ab", z, prior_weight=0.0)
    with_prior = slope("ab", z, prior_weight=0.4)
    assert with_prior[0] == pytest.approx(loss + 0.4 * 0.5 * (0.25 + 1.0))
    assert torch.allclose(with_prior[1], gradient + torch.tensor([0.2, -0.4]))
    assert torch.allclose(with_prior[2], curvature + 0.4 * torch.eye(2), atol=1e-5)


def test_of_several_fires_it_is_the_mean(slope):
    both, first, second = (slope(names, [0.0, 0.0], prior_weight=0.0) for names in ("ab", "a", "b"))
    for part, one, other in zip(both, first, second, strict=True):
        assert torch.allclose(torch.as_tensor(part), (torch.as_tensor(one) + torch.as_tensor(other)) / 2, atol=2e-6)


@pytest.mark.parametrize("loss", ["cross_entropy", "brier"])
def test_the_gradient_is_that_of_the_loss_by_the_margins(slope, monkeypatch, loss):
    # A step of z moves each margin by its slope
    before, (_, gradient, _) = FACTORS["a"], slope("a", [0.0, 0.0], prior_weight=0.0, loss=loss)
    for place, step in enumerate(1e-3 * torch.eye(2)):
        moved = [before + sign * (step[:, None, None, None] * SLOPES).sum(0) for sign in (1.0, -1.0)]
        losses = []
        for each in moved:
            monkeypatch.setitem(FACTORS, "a", each)
            losses.append(slope("a", [0.0, 0.0], prior_weight=0.0, loss=loss)[0])
        assert (losses[0] - losses[1]) / 2e-3 == pytest.approx(float(gradient[place]), rel=2e-2, abs=1e-3)


@pytest.mark.parametrize("loss", ["cross_entropy", "brier"])
def test_the_curvature_is_what_is_expected_of_the_loss_s_where_cells_burn_by_their_chances(slope, loss):
    # A cell's loss bends by x* as phi^2 / (p (1 - p)), Fisher's information of a Bernoulli trial, or 2 phi^2; over the
    # two cells that burned. Parameters move x* by their slopes.
    _, _, curvature = slope("a", [0.0, 0.0], prior_weight=0.0, softness=0.5, loss=loss)
    bends = torch.zeros(2, 2)
    for x, by in zip(FACTORS["a"].flatten().tolist(), SLOPES.flatten(1).T, strict=True):
        chance, density = NormalDist(0.0, 0.5).cdf(-x), NormalDist(0.0, 0.5).pdf(x)
        bend = 2.0 * density**2 if loss == "brier" else density**2 / (chance * (1.0 - chance))
        bends += bend / 2 * torch.outer(by, by)
    assert torch.allclose(curvature, bends, rtol=1e-4, atol=1e-5)
