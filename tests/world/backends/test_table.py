"""The table of probabilities by hand."""

import torch

from tests.world.drawing import draw
from warp_torchrl.world.backends.table import BESIDE, bit_of, burning_neighbours, pattern_table
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import is_burning

N, NE, E, SE, S, SW, W, NW = (1 << bit_of(direction) for direction in range(8))


def test_a_bit_stands_for_each_direction_that_fire_comes_in() -> None:
    # A fire in the middle travels north into the cell above it, north-east into the next, and so on clockwise.
    spreading = is_burning(draw("... .a. ...").cells)
    assert burning_neighbours(spreading)[0].tolist() == [[NW, N, NE], [W, 0, E], [SW, S, SE]]
    assert sorted((N, E, S, W, NE, SE, SW, NW)) == [1 << bit for bit in range(8)] and N | E | S | W == BESIDE


def test_nothing_comes_from_beyond_the_border_or_from_another_world() -> None:
    spreading = is_burning(draw("a.. ... ..a", worlds=2).cells)
    spreading[1] = False
    assert burning_neighbours(spreading)[0, 0].tolist() == [0, E, 0]
    assert not burning_neighbours(spreading)[1].any()


def test_a_table_by_hand() -> None:
    # Alpha 0.5, calm: 0.5 from the south (north-going), 0.5 / sqrt 2 = 0.3536 on the diagonal; both 1 - 0.5 x 0.6464.
    fire = Fire(alpha=(0.5, 0.0, 0.0, 0.0, 0.0))
    table = pattern_table(fire, fire.gain(torch.zeros(1, 2, 1, 1)))
    assert table.shape == (1, 6, 256) and not table[0, [0, 2, 3, 4, 5]].any()
    wanted = torch.tensor([0.0, 0.5, 0.35355339, 1.0 - 0.5 * 0.64644661])
    torch.testing.assert_close(table[0, 1, [0, N, NE, N | NE]], wanted)
