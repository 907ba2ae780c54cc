"""Directions and distances on drawn maps."""

import math

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.geometry import (
    DIRECTIONS,
    DISTANCES,
    FAR,
    chebyshev_distance,
    distance_to_nearest,
    flood,
    grow,
    nearest,
    unit_vectors,
)

from .drawing import marks


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


def test_distances_count_the_moves_of_a_king() -> None:
    mask = marked("x..x. ..... .x...")
    distance = chebyshev_distance(torch.tensor([[[0, 1], [2, 4]]]), mask)
    assert distance.dtype == torch.int16
    assert distance[0, 0].tolist() == [[1, FAR, FAR, 2, FAR], [FAR] * 5, [FAR, 2, FAR, FAR, FAR]]
    assert distance[0, 1].tolist() == [[4, FAR, FAR, 2, FAR], [FAR] * 5, [FAR, 3, FAR, FAR, FAR]]


def test_the_nearest_of_equals_is_the_first_in_reading_order() -> None:
    mask = marked(".x... ...x. .x...")
    distance, index = nearest(torch.tensor([[[1, 2], [0, 4]]]), mask)
    assert distance.tolist() == [[1, 1]]
    assert index.tolist() == [[1, 8]]


def test_where_nothing_is_marked_the_nearest_is_far() -> None:
    distance, _ = nearest(torch.tensor([[[1, 2]]]), marked("..... ....."))
    assert distance.tolist() == [[FAR]]


@pytest.mark.parametrize("shape", [(5, 7), (255, 40), (40, 256), (300, 300)])
@pytest.mark.parametrize("share", [0.0, 0.001, 0.1])
def test_the_distance_to_the_nearest_is_the_least_of_all(shape: tuple[int, int], share: float) -> None:
    generator = torch.Generator().manual_seed(shape[0])
    mask = torch.rand(3, *shape, generator=generator) < share
    mask[0, -1, -1] = True  # from the opposite corner it is as far as it can be
    position = torch.stack([torch.randint(side, (3, 2), generator=generator) for side in shape], dim=-1)
    position[0, 0] = 0
    assert torch.equal(distance_to_nearest(position, mask), nearest(position, mask)[0])


def test_distances_over_the_largest_map_fit() -> None:
    mask = torch.zeros(1, 4096, 4, dtype=torch.bool)
    mask[0, 4095, 0] = True
    distance, index = nearest(torch.tensor([[[0, 3]]]), mask)
    assert (distance.item(), index.item()) == (4095, 4095 * 4)


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


def test_a_flood_follows_a_long_corridor() -> None:
    drawing = "ooooooo ######o ooooooo o###### ooooooo"
    assert flood(marked("x...... ....... ....... ....... ......."), marked(drawing, "o"))[0, 4, 6]
