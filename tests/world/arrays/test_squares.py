"""The squares about agents, by hand."""

import torch

from warp_torchrl.world.arrays.squares import window


def test_a_window_is_the_square_about_the_agent_and_zero_off_the_map():
    plane = torch.arange(1, 26).view(1, 5, 5)
    seen = window(torch.tensor([[[0, 0], [4, 3]]]), (5, 5), 1).of(plane)
    assert seen[0, 0].tolist() == [[0, 0, 0], [0, 1, 2], [0, 6, 7]]
    assert seen[0, 1].tolist() == [[18, 19, 20], [23, 24, 25], [0, 0, 0]]


def test_windows_of_many_worlds_equal_slices():
    plane = torch.randint(0, 255, (3, 9, 7), dtype=torch.uint8)
    position = torch.stack((torch.randint(2, 7, (3, 5)), torch.randint(2, 5, (3, 5))), dim=-1)
    seen = window(position, (9, 7), 2).of(plane)
    for world in range(3):
        for agent in range(5):
            row, column = position[world, agent].tolist()
            assert (seen[world, agent] == plane[world, row - 2 : row + 3, column - 2 : column + 3]).all()
