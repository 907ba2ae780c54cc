"""The picture of what is near, by hand."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.env.observation import Surroundings
from warp_torchrl.world.state.state import FIRST_FIRE
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array


def shown(size, positions, burning, near):
    """What agents at given places on a map of old trees are shown of fires at given cells."""
    cover, age = torch.full((size, size), 3), torch.full((size, size), 5)
    team = Team(n_agents=len(positions), start="anywhere")
    world = small_world(landscape=Array(cover=cover, age=age), team=team)
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    cells = torch.full_like(state.cells, 5)
    for row, column in burning:
        cells[0, row, column] = FIRST_FIRE
    place = torch.tensor(positions)[None]
    state = state.replace(cells=cells, vehicles=state.vehicles.replace(position=place))
    return Surroundings(near=near)(state, world, world.forecast(state))


def test_a_fire_is_in_the_block_of_four_cells_in_which_it_burns_on_a_map_of_any_size():
    """The agent stands in block (10, 3), the fires burn in blocks (8, 5) and (10, 3), one of 16 cells and two."""
    for size in (48, 96):
        seen = shown(size, [(41, 14)], [(33, 22), (40, 12), (43, 15)], near=4)["near"][0, 0, 0]
        expected = torch.zeros(15, 15)
        expected[7 - 2, 7 + 2], expected[7, 7] = 255 * (1 / 16) ** 0.5, 255 * (2 / 16) ** 0.5
        assert torch.equal(seen, expected.to(torch.uint8))


def test_what_is_beyond_seven_blocks_or_the_map_is_not_shown():
    seen = shown(96, [(2, 2)], [(0, 28), (0, 32)], near=4)["near"][0, 0]
    assert seen[0].nonzero().tolist() == [[7, 14]], "the eighth block is not shown"
    fuel = seen[1] > 0
    assert fuel[7:, 7:].all() and not fuel[:7].any() and not fuel[:, :7].any()


def test_team_mates_are_counted_block_by_block_without_oneself():
    seen = shown(64, [(8, 8), (11, 11), (12, 8), (12, 11), (63, 63)], [(40, 40)], near=4)["near"][0, :, 2]
    assert seen[0, 7, 7] == 63 and seen[0, 8, 7] == 126 and seen[0].sum() == 189
    assert seen[2, 7, 7] == 63 and seen[2, 6, 7] == 126
    assert seen[4].sum() == 0


def test_blocks_as_large_as_those_of_the_picture_show_the_same():
    seen = shown(32, [(3, 30), (17, 5)], [(3, 29), (20, 20), (21, 20)], near=4)
    assert torch.equal(seen["near"], seen["picture"]) and (seen["near"][:, :, 0] > 0).any()


def test_it_is_shown_on_request_alone():
    world = small_world()
    assert "near" not in Surroundings().spaces(world)
    spaces = Surroundings(near=4).spaces(world)
    assert spaces["near"].symmetry.target.order == 1 and spaces["picture"].symmetry.target.order == 2
    assert Surroundings().spaces(world)["picture"].symmetry.target.order == 1
    with pytest.raises(ValueError, match=r"near must be in \[0, 64\], got 65"):
        Surroundings(near=65)
