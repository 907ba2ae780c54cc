"""The reward of Haksar and Schwager by hand."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.env.reward.round_fire import RoundFire
from warp_torchrl.world.law.lattice import LatticeFire
from warp_torchrl.world.mechanics.retardant.retardant import RetardantTeam
from warp_torchrl.world.terrain.array import Array

NORTH, EAST, SOUTH, WEST, SOUTH_EAST, STAY = 0, 2, 4, 6, 3, 10
FIELD = ["TTTTTT", "TTTTTT", "TTFTTT", "TFFFTT", "T.FTTT", "TTTTTT"]  # the middle is between rows and columns 2 and 3


def earned(at, *actions, **weights):
    """What aircraft over the field earn in one step."""
    codes = torch.tensor([[{"T": 5, "F": 11, ".": 0}[each] for each in row] for row in FIELD], dtype=torch.uint8)[None]
    land = Array(cover=torch.full((6, 6), 3), age=torch.full((6, 6), 5))
    team = RetardantTeam(n_agents=len(at))
    world = small_world(landscape=land, team=team, fire=LatticeFire(), steps_per_tick=1000)
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    vehicles = state.vehicles.replace(position=torch.tensor(at)[None])
    state = state.replace(cells=codes, burned=codes == 0, vehicles=vehicles)
    return RoundFire(**weights)(world.step(state, torch.tensor([actions])))[0, :, 0].tolist()


@pytest.mark.parametrize(
    ("at", "action", "reward"),
    [
        ((0, 0), STAY, -1.0),  # healthy, far from fire
        ((0, 0), SOUTH_EAST, 0.5),  # healthy, (2, 2) burns at its corner
        ((5, 0), STAY, 0.5),  # healthy, (4, 1) is burnt
        ((2, 2), STAY, 1.0),  # burns, a neighbour is healthy
        ((2, 2), SOUTH, -2.0),  # burns, all four neighbours do
        ((4, 2), WEST, 0.0),  # burnt
        ((5, 2), NORTH, 1.0),  # burns, (4, 3) is healthy
    ],
)
def test_the_cell_that_an_aircraft_comes_to_is_worth_as_much(at, action, reward):
    assert earned([at], action, turn=0.0) == [pytest.approx(reward)]


@pytest.mark.parametrize(
    ("at", "action", "reward"),
    [((0, 2), EAST, 1.0), ((0, 2), WEST, 0.0), ((5, 3), WEST, 1.0), ((5, 3), EAST, 0.0), ((0, 2), STAY, 1.0)],
)
def test_what_does_not_turn_counter_clockwise_earns_one(at, action, reward):
    assert earned([at], action, edge=0.0, interior=0.0, beside=0.0, far=0.0) == [pytest.approx(reward)]


@pytest.mark.parametrize(
    ("at", "action", "reward"),
    [
        (((0, 0), (0, 2)), (STAY, WEST), [0.0, -10.0]),  # it comes beside the first
        (((0, 0), (0, 1)), (STAY, EAST), [0.0, 1.0]),  # it parts from the first
        (((0, 0), (0, 1)), (WEST, STAY), [0.0, -10.0]),  # it stays beside it; the first need not care
        (((0, 0), (1, 2)), (STAY, WEST), [0.0, 0.0]),  # at the corner is no cell's distance
    ],
)
def test_of_two_the_later_one_keeps_away(at, action, reward):
    alone = {"edge": 0.0, "interior": 0.0, "beside": 0.0, "far": 0.0, "turn": 0.0}
    assert earned(at, *action, **alone) == [pytest.approx(each) for each in reward]
