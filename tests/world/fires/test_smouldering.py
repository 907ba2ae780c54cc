"""Embers that smoulder are found when they are due, whenever they were added."""

import torch

from warp_torchrl.world.fires.smouldering import Smouldering


def test_each_ember_is_due_once_in_the_first_tick_that_ends_after_it() -> None:
    draw = torch.Generator().manual_seed(0)
    smouldering, added, found = Smouldering(), [], []
    for tick in range(1, 61):
        end, count = 0.5 * tick, 7 if tick <= 40 else 0
        fire, cell, minutes = smouldering.due(end)
        assert ((minutes <= end) & (minutes > end - 0.5)).all()
        found += [*zip(fire.tolist(), cell.tolist(), minutes.tolist(), strict=True)]
        cells, then = torch.arange(count) + 10 * tick, end + 10.0 * torch.rand(count, generator=draw)
        smouldering.add(torch.full((count,), tick), cells, then)
        added += [(tick, *each) for each in zip(cells.tolist(), then.tolist(), strict=True)]
    assert sorted(found) == sorted(added) and len(smouldering) == 0
