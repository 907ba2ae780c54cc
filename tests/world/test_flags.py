"""Byte arithmetic gives what comparisons and choices give, for every byte."""

import pytest
import torch

from warp_torchrl.world.flags import above, at_least, at_most, below, choose, clear, count, equal, number

codes = torch.arange(256, dtype=torch.uint8).view(1, 16, 16)


@pytest.mark.parametrize("bound", [0, 1, 11, 127, 128, 255])
def test_comparisons(bound):
    assert torch.equal(at_least(codes, bound), codes >= bound)
    assert torch.equal(at_most(codes, bound), codes <= bound)
    assert torch.equal(equal(codes, bound), codes == bound)
    assert at_least(codes, bound).dtype == torch.bool


def test_comparisons_of_numbers():
    numbers = torch.linspace(-1.0, 1.0, 33).view(1, 3, 11)
    bounds = numbers.flip(2)
    assert torch.equal(below(numbers, bounds), numbers < bounds) and torch.equal(below(numbers, 0.0), numbers < 0.0)
    assert torch.equal(above(numbers, 0.0), numbers > 0.0) and above(numbers, 0.0).sum() == 16


@pytest.mark.parametrize("shape", [(2, 3, 5), (2, 8, 8), (3, 2, 24, 43), (1, 64, 129)])
def test_counts_of_maps_of_any_size(shape):
    mask = torch.rand(shape, generator=torch.Generator().manual_seed(0)) < 0.7
    assert torch.equal(count(mask), mask.sum((-2, -1), dtype=torch.int32))


def test_comparisons_of_parts_and_of_spread_out_planes():
    part = codes.flip(2)[:, ::2].expand(3, -1, -1)
    assert torch.equal(at_least(part, 100), part >= 100)


def test_choices():
    mask = torch.rand(1, 16, 16) < 0.5
    other = codes.flip(1)
    assert torch.equal(choose(mask, codes, other), torch.where(mask, codes, other))
    assert torch.equal(choose(mask, 11, other), torch.where(mask, torch.tensor(11, dtype=torch.uint8), other))
    assert torch.equal(clear(mask, codes), codes.masked_fill(mask, 0))
    assert torch.equal(number(mask), mask.to(torch.float32))
    assert count(mask.expand(2, -1, -1)).tolist() == [int(mask.sum())] * 2
    assert count(torch.ones(1, 300, 300, dtype=torch.bool)).item() == 90_000
