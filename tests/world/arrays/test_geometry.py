"""Directions and distances on drawn maps."""

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import pytest
import torch
from torch import Tensor

from tests.world.drawing import marks
from warp_torchrl.system.device import unread
from warp_torchrl.world.arrays.geometry import (
    DIRECTIONS,
    DISTANCES,
    flood,
    grow,
    neighbour_in,
    neighbours,
    unit_vectors,
)


def marked(drawing: str, mark: str = "x") -> Tensor:
    return marks(drawing, mark)[None]


def rows_of(mask: Tensor) -> str:
    return " ".join("".join("x" if cell else "." for cell in row) for row in mask[0].tolist())


def test_directions_go_round_clockwise_from_north() -> None:
    assert DIRECTIONS[0] == (-1, 0)  # rows grow south
    assert DIRECTIONS[2] == (0, 1)
    for direction in range(8):
        row, column = DIRECTIONS[direction]
        assert DIRECTIONS[(direction + 4) % 8] == (-row, -column)


def test_a_diagonal_neighbour_is_sqrt_2_away() -> None:
    assert pytest.approx([1.0, math.sqrt(2.0)] * 4) == DISTANCES


def test_unit_vectors_point_east_and_north() -> None:
    half = math.sqrt(0.5)
    wanted = [(0, 1), (half, half), (1, 0), (half, -half), (0, -1), (-half, -half), (-1, 0), (-half, half)]
    torch.testing.assert_close(unit_vectors(), torch.tensor(wanted))


def test_a_neighbour_is_what_lies_one_cell_on_and_nothing_beyond_the_map() -> None:
    plane = torch.arange(1, 7).view(1, 2, 3)
    assert neighbour_in(DIRECTIONS.index((0, 1)), plane).tolist() == [[[2, 3, 0], [5, 6, 0]]]
    assert neighbour_in(DIRECTIONS.index((-1, -1)), plane).tolist() == [[[0, 0, 0], [0, 1, 2]]]


def test_the_neighbours_of_all_cells_go_round_clockwise_from_north() -> None:
    plane = torch.arange(9.0).view(1, 3, 3)
    around = neighbours(plane, -1.0)
    assert around[:, 0, 1, 1].tolist() == [1.0, 2.0, 5.0, 8.0, 7.0, 6.0, 3.0, 0.0]
    assert around[:, 0, 0, 0].tolist() == [-1.0, -1.0, 1.0, 4.0, 3.0, -1.0, -1.0, -1.0], "beyond the map"


def test_a_mask_grows_by_one_cell_all_round_and_never_over_the_edge() -> None:
    assert rows_of(grow(marked(".....x ...... ...... x....."))) == "....xx ....xx xx.... xx...."
    assert rows_of(grow(marked("..... ..... ..x.. ..... ....."))) == "..... .xxx. .xxx. .xxx. ....."


def test_a_mask_grows_by_its_radius() -> None:
    mask = marked("x...... ....... ....... .......")
    assert rows_of(grow(mask, 2)) == "xxx.... xxx.... xxx.... ......."
    assert rows_of(grow(mask, 0)) == rows_of(mask)


def test_growing_leaves_its_argument_and_the_other_worlds_alone() -> None:
    mask = torch.cat((marked("x.. ..."), marked("... ...")))
    before = mask.clone()
    assert not grow(mask, 3)[1].any()
    assert torch.equal(mask, before)


def test_a_flood_goes_round_walls_and_through_corners_of_open_cells() -> None:
    # o is open, # a wall: from the left it goes round by the top and slips through a diagonal gap, not further.
    drawing = "ooo#o o#o## oo#oo ###oo"
    reached = flood(marked("x.... ..... ..... ....."), marked(drawing, "o"))
    # (1, 2) touches (2, 3) diagonally; (0, 4) touches only walls.
    assert rows_of(reached) == "xxx.. x.x.. xx.xx ...xx"


def test_a_seed_that_is_not_open_floods_but_is_not_reached() -> None:
    assert rows_of(flood(marked("x..."), marked("#oo#", "o"))) == ".xx."


@pytest.mark.parametrize("device", [nullcontext, unread], ids=["read freely", "never read"])
def test_a_flood_follows_a_long_corridor(device: Callable[[], AbstractContextManager[None]]) -> None:
    drawing = "ooooooo ######o ooooooo o###### ooooooo"
    with device():
        reached = flood(marked("x...... ....... ....... ....... ......."), marked(drawing, "o"))
    assert rows_of(reached) == "xxxxxxx ......x xxxxxxx x...... xxxxxxx"
