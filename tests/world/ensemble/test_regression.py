"""Emulator: quadratics of parameters, and what it leaves open."""

import pytest
import torch

from warp_torchrl.world.ensemble.regression import Emulator


def drawn(count, seed=0):
    return torch.randn(count, 2, generator=torch.Generator().manual_seed(seed)) * torch.tensor([0.3, 20.0])


def results(values):
    """A quadratic of both parameters, and one that depends on none."""
    first, second = values.unbind(1)
    return torch.stack((1.0 + 2.0 * first - 0.03 * second + 0.1 * first * second, torch.full_like(first, 5.0)), 1)


def test_a_quadratic_is_found_and_little_is_left():
    emulator, others = Emulator.fitted(drawn(60), results(drawn(60))), drawn(9, seed=1)
    mean, variance = emulator(others)
    assert torch.allclose(mean, results(others).double(), atol=0.02) and float(variance[:, 0].max()) < 0.01


def test_what_parameters_do_not_explain_is_the_variance():
    noise = 0.5 * torch.randn(200, 2, generator=torch.Generator().manual_seed(2))
    emulator = Emulator.fitted(drawn(200), results(drawn(200)) + noise)
    assert emulator.variance.sqrt().tolist() == pytest.approx([0.5, 0.5], rel=0.15)


def test_few_members_say_less_than_many_and_nothing_far_away():
    noise = 0.3 * torch.randn(200, 2, generator=torch.Generator().manual_seed(3))
    near, far = torch.zeros(1, 2), torch.tensor([[2.0, 100.0]])
    many, few = (Emulator.fitted(drawn(200)[:n], (results(drawn(200)) + noise)[:n]) for n in (200, 12))
    assert float(few(near)[1][0, 0] / few.variance[0]) > float(many(near)[1][0, 0] / many.variance[0])
    assert float(many(far)[1][0, 0]) > 2.0 * float(many(near)[1][0, 0])


def test_parameters_that_do_not_differ_are_left_out():
    values = drawn(30)
    values[:, 1] = 0.0
    mean, _ = Emulator.fitted(values, results(values))(values)
    assert torch.allclose(mean, results(values).double(), atol=0.02)
