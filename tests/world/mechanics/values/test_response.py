"""Losses of assets."""

import pytest
import torch

from warp_torchrl.system.device import unread
from warp_torchrl.world.mechanics.values.response import HOMES, kept, share_left


def test_what_is_left_is_worth_less_losses_by_flames_and_embers():
    # 2 of worth under flames of 1 m lose 0.4, 1 that an ember spares with 0.9 loses 0.1: of 4, 3.1 are left.
    worth = torch.tensor([[[2.0, 1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0, 0.0]]])
    flames = torch.tensor([[[1.0, 0.0, 0.0, 5.0]], [[9.0, 0.0, 0.0, 0.0]]])
    spared = torch.tensor([[[1.0, 0.9, 1.0, 0.5]], [[1.0, 1.0, 1.0, 1.0]]])
    assert share_left(worth, flames, spared, HOMES).tolist() == pytest.approx([3.1 / 4.0, 1.0])
    with unread():
        assert share_left(worth, flames, spared, HOMES).tolist() == pytest.approx([3.1 / 4.0, 1.0])


def test_what_is_left_of_many_cells_is_that_of_whole_maps():
    draw = torch.rand(3, 4, 24, 24, generator=torch.Generator().manual_seed(0))
    worth, flames, spared = draw[0].round(), 8.0 * (draw[1] - 0.5).clamp(min=0.0), (draw[2] + 0.3).clamp(max=1.0)
    whole = (worth * kept(flames, spared, HOMES)).flatten(1).sum(1) / worth.flatten(1).sum(1)
    assert torch.equal(share_left(worth, flames, spared, HOMES), whole)
    turned = worth.transpose(1, 2).contiguous().transpose(1, 2)  # as a layer may lie in memory
    assert torch.equal(share_left(turned, flames, spared, HOMES), whole)
