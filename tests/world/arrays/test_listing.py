"""Marked cells as lists."""

import torch

from warp_torchrl.system.device import unread
from warp_torchrl.world.arrays.listing import flat_cells, in_all, places


def test_places_are_found_word_by_word() -> None:
    generator = torch.Generator().manual_seed(0)
    for count in (0, 1, 7, 8, 63, 64, 4096, 4097):
        for share in (0.0, 0.03, 1.0):
            codes = (torch.rand(count, generator=generator) < share).to(torch.uint8) * 131
            assert places(codes).tolist() == [index for index, code in enumerate(codes.tolist()) if code]


def test_marked_cells_are_those_of_all_maps_or_every_cell_where_nothing_is_read() -> None:
    mask = torch.zeros(2, 3, 4, dtype=torch.bool)
    mask[0, 1, 2] = mask[1, 2, 3] = True
    assert flat_cells(mask).tolist() == [6, 23]
    with unread():
        assert flat_cells(mask).tolist() == list(range(24))


def test_cells_of_each_map_are_numbered_through_all_maps() -> None:
    assert in_all(torch.tensor([[0, 5], [0, 11]]), 12).tolist() == [[0, 5], [12, 23]]
