"""The mixers against their published numbers."""

import torch

from warp_torchrl.world.arrays.hashing import mixed, splitmix64

GOLDEN = -7046029254386353131  # 0x9E3779B97F4A7C15


def test_splitmix64_gives_its_published_numbers() -> None:
    # The first three outputs of Vigna's splitmix64.c from the state 1234567.
    state = 1234567 + torch.arange(1, 4) * GOLDEN
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert [number % 2**64 for number in splitmix64(state).tolist()] == published


def test_a_draw_is_the_number_that_it_was() -> None:
    index, low, high = (torch.tensor([each], dtype=torch.int32) for each in (12, 345, -678))
    assert mixed(index, low, high).item() == 0.23671481013298035
