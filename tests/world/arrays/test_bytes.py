"""Byte arithmetic gives what comparisons and choices give, for every byte."""

import pytest
import torch

from warp_torchrl.world.arrays import bytes as fast_bytes
from warp_torchrl.world.arrays.bytes import (
    above,
    at_least,
    below,
    between,
    byte,
    choose,
    counts,
    equal,
    number,
    scatter_add,
    zero_where,
)

codes = torch.arange(256, dtype=torch.uint8).view(1, 16, 16)


@pytest.mark.parametrize("bound", [0, 1, 11, 127, 128, 255])
def test_comparisons(bound):
    assert torch.equal(at_least(codes, bound), codes >= bound)
    assert torch.equal(between(codes, 0, bound), codes <= bound)
    assert torch.equal(between(codes, bound, 255), codes >= bound)
    assert torch.equal(between(codes, bound // 2, bound), (codes >= bound // 2) & (codes <= bound))
    assert torch.equal(equal(codes, bound), codes == bound)
    assert at_least(codes, bound).dtype == torch.bool


def test_comparisons_of_numbers():
    numbers = torch.linspace(-1.0, 1.0, 33).view(1, 3, 11)
    bounds = numbers.flip(2)
    assert torch.equal(below(numbers, bounds), numbers < bounds) and torch.equal(below(numbers, 0.0), numbers < 0.0)
    assert torch.equal(above(numbers, 0.0), numbers > 0.0) and above(numbers, 0.0).sum() == 16


@pytest.mark.parametrize("shape", [(2, 1, 3, 5), (2, 4, 8, 8), (3, 2, 24, 43), (1, 1, 64, 129)])
def test_counts_of_maps_of_any_size(shape):
    masks = (torch.rand(shape, generator=torch.Generator().manual_seed(0)) < 0.7).unbind()
    for mask, found in zip(masks, counts(*map(byte, masks)), strict=True):
        assert torch.equal(found, mask.sum((-2, -1), dtype=torch.int32))


def test_comparisons_of_parts_and_of_spread_out_planes():
    part = codes.flip(2)[:, ::2].expand(3, -1, -1)
    assert torch.equal(at_least(part, 100), part >= 100)


def test_choices():
    mask = torch.rand(1, 16, 16) < 0.5
    other = codes.flip(1)
    assert torch.equal(choose(byte(mask), codes, other), torch.where(mask, codes, other))
    assert torch.equal(choose(byte(mask), 11, other), torch.where(mask, torch.tensor(11, dtype=torch.uint8), other))
    assert torch.equal(zero_where(byte(mask), codes), codes.masked_fill(mask, 0))
    assert torch.equal(number(mask), mask.to(torch.float32))
    assert counts(byte(mask).expand(2, -1, -1))[0].tolist() == [int(mask.sum())] * 2
    assert counts(torch.ones(1, 300, 300, dtype=torch.uint8))[0].item() == 90_000


@pytest.mark.parametrize("on_a_compiled_gpu", [False, True])
def test_sums_at_places_wrap_around(on_a_compiled_gpu, monkeypatch):
    given, place = torch.tensor([[250, 7, 9]], dtype=torch.uint8), torch.tensor([[0, 0, 2]])
    if on_a_compiled_gpu:
        monkeypatch.setattr(fast_bytes, "is_fused", lambda: True)
        monkeypatch.setattr(fast_bytes, "_ADDS_BYTES", ())
    found = scatter_add(given, place, torch.tensor([[5, 4, 255]], dtype=torch.uint8))
    assert found.tolist() == [[3, 7, 8]] and found.dtype == torch.uint8
