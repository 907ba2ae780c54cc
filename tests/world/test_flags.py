"""Byte arithmetic gives what comparisons and choices give, for every byte."""

import pytest
import torch

from warp_torchrl.world.flags import at_least, at_most, choose, clear, count, equal, number

codes = torch.arange(256, dtype=torch.uint8).view(1, 16, 16)


@pytest.mark.parametrize("bound", [0, 1, 11, 127, 128, 255])
def test_comparisons(bound):
    assert torch.equal(at_least(codes, bound), codes >= bound)
    assert torch.equal(at_most(codes, bound), codes <= bound)
    assert torch.equal(equal(codes, bound), codes == bound)
    assert at_least(codes, bound).dtype == torch.bool


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
