"""Evolution keeps the best of all generations, by the loss of the fires and of the prior."""

import numpy as np
import pytest
import torch

from tests.prediction.calibration.ground import fire
from warp_torchrl.prediction.calibration.evolution import Evolution
from warp_torchrl.prediction.calibration.parameters import parameters_of


class Asked:
    """A strategy that asks for given candidates, and keeps what it is told."""

    def __init__(self, *generations):
        self.left, self.told = list(generations), []

    def ask(self):
        return [np.array([each]) for each in self.left.pop(0)]

    def tell(self, asked, losses):
        self.told.append(losses)


@pytest.mark.parametrize(
    ("losses", "best", "least"),
    [
        ([[3.0, 1.0], [2.0, 5.0], [4.0, 6.0]], 0.2, [1.0, 1.0, 1.0]),
        ([[3.0, 2.0], [5.0, 1.0], [4.0, 0.5]], 0.6, [2.0, 1.0, 0.5]),
    ],
)
def test_the_best_candidate_of_all_generations_is_returned(monkeypatch, losses, best, least):
    strategy, left, heard = Asked([0.1, 0.2], [0.3, 0.4], [0.5, 0.6]), [torch.tensor(each) for each in losses], []
    monkeypatch.setattr(Evolution, "_strategy", lambda *given: strategy)
    monkeypatch.setattr(Evolution, "losses", lambda *given: left.pop(0))
    start = fire()
    z = Evolution(generations=3)(start, parameters_of(["rate_gain"], start), [], lambda *given: heard.append(given))
    assert z.tolist() == pytest.approx([best]) and strategy.told == losses
    assert heard == [(number, each) for number, each in enumerate(least, start=1)]


def test_a_candidate_s_loss_is_the_mean_of_the_fires_and_half_its_square(monkeypatch):
    of_fires = {"a": torch.tensor([0.2, 0.4]), "b": torch.tensor([0.6, 0.0])}
    monkeypatch.setattr(Evolution, "_of_case", lambda self, laws, case, drawn: of_fires[case])
    start, z = fire(), torch.tensor([[1.0, -2.0], [0.0, 0.0]])
    found = Evolution(prior_weight=0.1).losses(start, parameters_of(["rate_gain", "wind_gain"], start), z, ["a", "b"])
    assert found.tolist() == pytest.approx([0.4 + 0.1 * 0.5 * 5.0, 0.2])
