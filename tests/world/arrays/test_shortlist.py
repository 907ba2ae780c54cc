"""Lists of the first marked cells of worlds."""

import pytest
import torch

from warp_torchrl.system.device import unread
from warp_torchrl.world.arrays.shortlist import first_cells


@pytest.mark.parametrize("count", [1, 3, 64, 200])
def test_lists_are_the_same_where_nothing_is_read_but_for_padding(count):
    share = torch.tensor([0.0, 0.02, 0.3, 1.0])[:, None, None]
    marked = torch.rand(4, 9, 16, generator=torch.Generator().manual_seed(0)) < share
    cell, is_there = first_cells(marked, count)
    with unread():
        whole, all_there = first_cells(marked, count)
    length = cell.shape[1]
    assert length == min(count, 192) and not all_there[:, length:].any()
    assert torch.equal(is_there, all_there[:, :length]) and torch.equal(cell[is_there], whole[all_there])


def test_the_first_cells_are_listed_in_row_major_order():
    marked = torch.tensor([[[0, 1, 0], [1, 0, 1]], [[0, 0, 0], [0, 0, 1]]]).bool()
    cell, is_there = first_cells(marked, 2)
    assert cell[0].tolist() == [1, 3] and is_there.tolist() == [[True, True], [True, False]] and cell[1, 0] == 5


def test_a_list_is_no_longer_than_the_marks_need():
    marked = torch.zeros(2, 40, 40, dtype=torch.bool)
    marked[1, 0, :5] = True
    assert first_cells(marked, 1000)[0].shape == (2, 64)
