"""Means over blocks."""

import pytest
import torch

from warp_torchrl.world.arrays.blocks import block_means


@pytest.mark.parametrize("shape", [(16, 16), (32, 48), (64, 16), (20, 30), (12, 16)])
def test_block_means_are_those_of_pooling(shape):
    maps = torch.rand(3, 2, *shape)
    for side in (8, 16):
        if min(shape) >= side:
            torch.testing.assert_close(block_means(maps, side), torch.nn.functional.adaptive_avg_pool2d(maps, side))


@pytest.mark.parametrize("shape", [(16, 16), (40, 1024), (5120, 16), (20, 30)])
def test_block_means_of_a_mask_are_the_shares_that_are_set(shape):
    mask = torch.rand(2, *shape) < 0.9
    torch.testing.assert_close(block_means(mask, 8), block_means(mask.to(torch.float32), 8))
    assert (block_means(torch.ones(1, *shape, dtype=torch.bool), 8) == 1.0).all()
