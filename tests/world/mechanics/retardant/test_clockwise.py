"""The heuristic of Haksar and Schwager by hand, on 12 x 12 cells with the middle between rows and columns 5 and 6."""

import pytest
import torch

from warp_torchrl import make_env
from warp_torchrl.evaluation.play import play
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.mechanics.retardant.retardant import Missions

NORTH, NORTH_EAST, EAST, SOUTH_EAST, SOUTH, STAY = 0, 1, 2, 3, 4, 10
NOTHING = {}
FIRE, BURNT = 11, 0


def chosen(at, cells=NOTHING, arrived=True, overrides=()):
    """What aircraft choose on healthy ground but for some cells."""
    size = ["landscape.size=12", "horizon=100", f"team.n_agents={len(at)}", *overrides]
    env = make_env("haksar", n_worlds=1, overrides=size)
    env.reset()
    state = env.world_state
    codes, burned = torch.full_like(state.cells, 10), torch.zeros_like(state.burned)
    for (row, column), code in cells.items():
        codes[0, row, column], burned[0, row, column] = code, code == BURNT
    place = torch.tensor(at)[None]
    vehicles = state.vehicles.replace(position=place)
    state = state.with_planes("retardant", Missions(torch.full((1, len(at)), arrived)))
    now = env.set_state(state.replace(cells=codes, burned=burned, vehicles=vehicles))
    now = HEURISTICS["clockwise"](env)(now)["agents"]
    assert now["action_mask"].gather(-1, now["action"][..., None]).all()
    return now["action"][0].tolist()


@pytest.mark.parametrize(("at", "move"), [((0, 0), SOUTH_EAST), ((5, 0), EAST), ((0, 6), SOUTH), ((11, 2), NORTH_EAST)])
def test_it_flies_to_the_middle_until_it_is_over_the_fire(at, move):
    assert chosen([at], arrived=False) == [move]
    assert chosen([at], {at: BURNT}, arrived=False) != [move]


# At (1, 5), north of the middle, clockwise is east, and outwards are north-east, and north before it.
@pytest.mark.parametrize(
    ("cells", "move"),
    [
        ({(0, 6): FIRE}, NORTH_EAST),
        ({(0, 5): FIRE, (0, 6): FIRE}, NORTH),
        ({(0, 5): BURNT, (0, 6): FIRE}, NORTH_EAST),
        ({(0, 5): BURNT, (0, 6): BURNT}, NORTH),
        ({(0, 6): BURNT}, NORTH_EAST),
        ({(1, 6): FIRE}, EAST),
        ({(2, 5): FIRE, (2, 6): FIRE, (2, 7): FIRE}, EAST),  # five healthy trees about (1, 6)
        ({(2, 5): FIRE, (2, 6): FIRE}, SOUTH_EAST),  # six
        ({}, SOUTH_EAST),
    ],
)
def test_at_the_fire_it_goes_round_the_middle_along_the_edge(cells, move):
    assert chosen([(1, 5)], cells) == [move]


def test_the_later_of_two_stays_where_it_would_come_within_a_cell_of_the_other():
    edge = {(2, column): FIRE for column in range(12)}
    assert chosen([(1, 6), (1, 4)], edge) == [EAST, STAY]
    assert chosen([(1, 4), (1, 6)], edge) == [EAST, EAST]
    assert chosen([(1, 8), (1, 4)], edge)[1] == EAST, "two cells away"


def test_a_move_off_the_map_is_made_along_its_border():
    # At (8, 0), south of the middle's row, north-west is the most clockwise; few trees about it are healthy.
    assert chosen([(8, 0)], {(6, 0): FIRE, (7, 0): FIRE, (8, 0): FIRE}) == [NORTH]


@pytest.mark.slow
def test_it_saves_what_nobody_does():
    env = make_env("haksar", n_worlds=24, overrides=["landscape.size=20", "horizon=400"])
    noop, clockwise = (play(env, HEURISTICS[name](env), 0)["saved"].mean() for name in ("noop", "clockwise"))
    assert clockwise > noop + 0.2
