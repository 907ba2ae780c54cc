"""Particle filter, in numbers worked out by hand."""

import math

import pytest
import torch

from warp_torchrl.world.ensemble.filtering import (
    effective,
    exponent,
    jittered,
    moments,
    normalised,
    quantiles,
    resampled,
)


def test_weights_are_shares_of_the_likelihoods():
    # e^0 : e^ln 3 is 1 : 3; where none can be, all are alike
    logs = torch.tensor([[0.0, math.log(3.0)], [-1000.0, -1000.0], [-torch.inf, -torch.inf], [-torch.inf, 5.0]])
    assert normalised(logs).flatten().tolist() == pytest.approx([0.25, 0.75, 0.5, 0.5, 0.5, 0.5, 0.0, 1.0])


def test_the_effective_number_is_one_over_the_sum_of_squares():
    weights = torch.tensor([[0.25, 0.75, 0.0, 0.0], [0.25, 0.25, 0.25, 0.25], [1.0, 0.0, 0.0, 0.0]])
    assert effective(weights).tolist() == pytest.approx([1.6, 4.0, 1.0])  # 1 / (1/16 + 9/16)


def test_members_are_taken_by_their_weight_times_their_number():
    # Sums 0.1, 0.6, 0.6, 1; places (k + 0.5) / 4 = 0.125, 0.375, 0.625, 0.875; and k / 4 = 0, 0.25, 0.5, 0.75
    weights = torch.tensor([[0.1, 0.5, 0.0, 0.4]]).expand(2, -1)
    assert resampled(weights, torch.tensor([0.5, 0.0])).tolist() == [[1, 1, 3, 3], [0, 1, 1, 3]]
    assert resampled(torch.ones(2, 1), torch.tensor([0.0, 0.99])).tolist() == [[0], [0]]
    assert resampled(torch.full((1, 5), 0.2), torch.tensor([0.3])).tolist() == [[0, 1, 2, 3, 4]]
    assert resampled(weights[:1], torch.tensor([0.5]), 2).tolist() == [[1, 3]], "places 0.25 and 0.75"


def test_a_member_without_weight_is_never_taken():
    draws = torch.linspace(0.0, 1.0 - 2.0**-24, 101)
    weights = torch.tensor([[0.0, 0.3, 0.0, 0.7, 0.0]]).expand(101, -1)
    taken = resampled(weights, draws)
    assert taken.dtype == torch.int64 and set(taken.flatten().tolist()) == {1, 3}
    assert all(abs((row == 1).sum() - 1.5) <= 0.5 for row in taken), "1.5 times, rounded"


def test_a_batch_is_what_each_filter_is_alone():
    draws = torch.Generator().manual_seed(0)
    logs, draw = 3.0 * torch.randn(6, 9, generator=draws), torch.rand(6, generator=draws)
    weights = normalised(logs)
    for one in range(6):
        alone = normalised(logs[one : one + 1])
        assert torch.equal(alone[0], weights[one])
        assert torch.equal(effective(alone)[0], effective(weights)[one])
        assert torch.equal(resampled(alone, draw[one : one + 1])[0], resampled(weights, draw)[one])


def test_moved_parameters_keep_mean_and_covariance():
    draws = torch.Generator().manual_seed(1)
    values = torch.randn(1, 20_000, 2, generator=draws) @ torch.tensor([[1.0, 0.8], [0.0, 0.3]])
    weights = normalised(torch.zeros(1, 20_000))
    mean, covariance = moments(values, weights)
    moved = jittered(values, mean, covariance, torch.randn(values.shape, generator=draws), 0.8)
    after = moments(moved, weights)
    assert torch.allclose(after[0], mean, atol=0.02) and torch.allclose(after[1], covariance, atol=0.03)
    assert float((moved - values).std()) > 0.3


def test_moments_are_weighted():
    # Of 0 and 4 with weights 1/4 and 3/4: mean 3, variance 9/4 + 3/4 = 3
    mean, variance = moments(torch.tensor([[[0.0], [4.0]]]), torch.tensor([[0.25, 0.75]]))
    assert mean.item() == 3.0 and variance.item() == 3.0


def test_quantiles_are_the_least_values_with_their_share_of_the_weight():
    values, weights = torch.tensor([[3.0, 1.0, 2.0]]), torch.tensor([[0.2, 0.5, 0.3]])
    assert quantiles(values, weights, torch.tensor([0.05, 0.5, 0.6, 0.95])).tolist() == [[1.0, 1.0, 2.0, 3.0]]


def test_a_likelihood_is_tempered_until_enough_members_are_left():
    # Two members, l = (0, -4): weights 1 : e^-4b; 1 / sum w^2 is 1.6 at 1 : 3, so b = ln 3 / 4
    none, far = torch.zeros(2, 2), torch.tensor([[0.0, -4.0], [0.0, -0.1]])
    assert exponent(none, far, 1.6).tolist() == pytest.approx([math.log(3.0) / 4.0, 1.0], abs=1e-4)
