"""The shape of a fire, by hand."""

import pytest
import torch

from tests.world.drawing import draw, marks
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.front import (
    alignment,
    block_shares,
    centre,
    containment,
    exposure,
    sector,
    spreading_front,
)

FIELD = " ".join(["T" * 15] * 7 + ["T" * 7 + "a" + "T" * 7] + ["T" * 15] * 7)  # fire in the middle of 15 x 15


def test_the_centre_is_the_mean_place_or_the_map_s_middle() -> None:
    both = torch.stack((marks(".#. ... .##", "#"), marks("... ... ...", "#")))
    # (0, 1), (2, 1), (2, 2)
    torch.testing.assert_close(centre(both), torch.tensor([[4 / 3, 4 / 3], [1.0, 1.0]]))


def test_alignment_is_the_cosine_to_the_wind() -> None:
    wind = torch.tensor([3.0, 0.0])[None, :, None, None]  # to the east
    places = torch.tensor([[[5, 9], [5, 1], [1, 5], [2, 8], [5, 5]]])
    found = alignment(places, torch.tensor([[5.0, 5.0]]), wind)
    torch.testing.assert_close(found, torch.tensor([[1.0, -1.0, 0.0, 0.5**0.5, 0.0]]))
    north = alignment(torch.tensor([[[1, 5]]]), torch.tensor([[5.0, 5.0]]), wind.flip(1))
    assert north.item() == pytest.approx(1.0)
    assert alignment(places, torch.tensor([[5.0, 5.0]]), 0.0 * wind).abs().max() == 0.0


def test_sectors_go_round_clockwise_from_the_east() -> None:
    places = torch.tensor([[[5, 9], [6, 9], [9, 9], [5, 1], [1, 5], [4, 9]]])
    # East itself, just south of it, south-east (45 degrees), west, north, just north of east.
    assert sector(places, torch.tensor([[5.0, 5.0]])).tolist() == [[0, 0, 1, 4, 6, 7]]


def test_exposure_is_the_share_of_trees_near_fire() -> None:
    # 9 cells, one of them alight: 8 within one cell, of 9 initial trees; a lake and an ember's like do not count.
    state = draw("TTT TaT TTT")
    assert exposure(state, count_trees(state), 1).item() == pytest.approx(8 / 9)
    state = draw(FIELD)
    assert exposure(state, count_trees(state), 3).item() == pytest.approx(48 / 225)
    state = draw("TTT TTT TTT")
    assert exposure(state, count_trees(state), 3).item() == 0.0


def test_containment_counts_the_rays_that_meet_a_barrier() -> None:
    fire = draw(FIELD).cells > 10
    none = torch.zeros(1, 15, 15, dtype=torch.bool)
    assert containment(fire, none).item() == 0.0
    ring = none.clone()
    ring[:, 3:12, 3:12] = True
    ring[:, 4:11, 4:11] = False
    assert containment(fire, ring).item() == 1.0
    # A wall three columns east, from border to border: rays up to 67.5 degrees off east meet it, 13 of 32.
    wall = none.clone()
    wall[:, :, 10] = True
    assert containment(fire, wall).item() == pytest.approx(13 / 32)
    assert containment(none, none).item() == 1.0


def test_blocks_count_among_their_own_cells() -> None:
    mask, among = torch.zeros(1, 4, 6, dtype=torch.bool), torch.ones(1, 4, 6, dtype=torch.bool)
    mask[:, :2, :2] = True
    among[:, 2:, 4:] = False
    shares = block_shares(mask, among, side=4)
    # The left block 4 of 16; the right one, 4 x 2 of which the upper half counts, none.
    assert shares.tolist() == [[[0.25, 0.0]]]


def test_the_front_is_what_burns_and_can_spread() -> None:
    state = draw("TaT .e. ..a")  # the ember spreads no more, and the last one has nothing beside it that can burn
    assert spreading_front(state.cells, state.alpha)[0].tolist() == [[False, True, False], [False] * 3, [False] * 3]
    lakes = draw("aT", ground="g~")  # no ground that can burn
    assert not spreading_front(lakes.cells, lakes.alpha).any()
