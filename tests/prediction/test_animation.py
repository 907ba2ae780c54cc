"""One fire in pictures."""

import numpy as np
import torch

from warp_torchrl.prediction.animation import _ASH, _FLAME, _frame


def pixels(arrival, minute, burns_for=10.0):
    ground = torch.full((*arrival.shape, 3), 200.0)
    return np.asarray(_frame(ground, arrival, minute, burns_for)).astype(int)


def test_what_burns_is_flame_for_a_while_and_then_ash():
    arrival = torch.tensor([[0.0, 15.0, 20.0, 21.0, torch.nan]])
    row = pixels(arrival, 20.0)[10, 48::96].tolist()
    assert row == [[*_ASH], [*_FLAME], [*_FLAME], [200] * 3, [200] * 3]  # of minutes 10 to 20 it burns still
    assert pixels(arrival, 25.0)[10, 48::96].tolist()[:2] == [[*_ASH], [*_ASH]], "15 was 10 minutes ago"


def test_a_map_of_more_cells_than_pixels_shows_their_mean_and_of_fewer_each_cell():
    wide = torch.tensor([0.0, torch.nan]).repeat(4, 480)
    mean = [(each + 200) / 2 for each in _FLAME]
    assert np.abs(pixels(wide, 1.0)[:2] - mean).max() <= 1
    few = pixels(torch.tensor([[0.0, torch.nan]]), 1.0)
    assert few.shape == (240 + 24, 480, 3)
    assert (few[:240, :240] == _FLAME).all() and (few[:240, 240:] == 200).all()
