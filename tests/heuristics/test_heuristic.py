"""Heuristics where sight is limited: they act on what agents know, and those that know of no fire search."""

import pytest
import torch

from tests.heuristics.drawing import scene
from tests.world.drawing import draw, knowing
from tests.world.mechanics.drawing import begun
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.heuristics.paths import first_move
from warp_torchrl.heuristics.seeking import can_act_on_fire, seek
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.world import World

Sight = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing").Sight
FIELD = " ".join(["T" * 9] * 9)


def rules(*roles, size=9):
    land = Array(cover=[[3] * size] * size, age=[[10] * size] * size)
    team = Team(n_agents=len(roles), roles=roles)
    return World(landscape=land, wind=Calm(), team=team, sensing=Sight(radius=1))


def acts(world, state, name="dispatch"):
    actions = HEURISTICS[name](WildfireEnv(world, n_worlds=1, seed=0)).act(state, world.possible_actions(state))
    return [Action(each).name for each in actions[0].tolist()]


def stale(world, *patches, at):
    """A world of which all is fresh but patches, each its rows and columns."""
    state = draw(FIELD, team=world.team, at=at).replace(step=torch.tensor([300], dtype=torch.int32))
    records = torch.full((1, len(at), 9, 9), 301 * 64 + 10, dtype=torch.int32)
    for rows, columns in patches:
        records[:, :, rows, columns] = 10
    return knowing(state, records)


NORTH, SOUTH = (slice(0, 3), slice(3, 6)), (slice(6, 9), slice(3, 6))
LESS_NORTH, LESS_SOUTH = (slice(0, 2), slice(3, 6)), (slice(7, 9), slice(3, 6))


def test_of_two_places_as_far_the_richer_is_sought():
    world = rules("ugv")
    assert acts(world, stale(world, NORTH, LESS_SOUTH, at=[(4, 4)])) == ["NORTH"]
    assert acts(world, stale(world, LESS_NORTH, SOUTH, at=[(4, 4)])) == ["SOUTH"]


def test_agents_search_apart_from_each_other():
    world = rules("ugv", "ugv")
    assert sorted(acts(world, stale(world, NORTH, SOUTH, at=[(4, 4), (4, 4)]))) == ["NORTH", "SOUTH"]


def test_agents_that_know_of_a_fire_fight_it_and_the_others_search():
    world = rules("ugv", "ugv")
    fire = FIELD[:1] + "a" + FIELD[2:]  # beside the first alone, which has told nobody
    state = begun(world, (0, 0), (8, 8), drawing=fire)
    mask = world.possible_actions(state)
    sought = [Action(each).name for each in seek(state, world.assumed(state), world, mask)[0].tolist()]
    assert acts(world, state) == ["EXTINGUISH", sought[1]] and Action[sought[1]] < 8
    none = begun(world, (0, 0), (8, 8), drawing=FIELD)
    mask = world.possible_actions(none)
    sought = seek(none, world.assumed(none), world, mask)[0].tolist()
    assert acts(world, none) == [Action(each).name for each in sought]


class Easterly(Heuristic):
    """A heuristic that goes east, fire or not."""

    def choose(self, state, mask):
        return torch.full(mask.shape[:2], int(Action.EAST))


def test_what_is_chosen_without_a_known_fire_is_not_done():
    world = rules("ugv")
    env = WildfireEnv(world, n_worlds=1, seed=0)
    state = stale(world, NORTH, at=[(4, 4)])
    assert Easterly(env).act(state, world.possible_actions(state)).tolist() == [[Action.NORTH]]
    known = begun(world, (4, 4), drawing=FIELD[:44] + "a" + FIELD[45:])
    assert Easterly(env).act(known, world.possible_actions(known)).tolist() == [[Action.EAST]]


def test_scouts_search_though_they_know_of_a_fire():
    world = rules("scout", "ugv")
    assert can_act_on_fire(world, torch.device("cpu")).tolist() == [False, True]
    state = begun(world, (4, 4), (4, 4), drawing=FIELD[:44] + "a" + FIELD[45:])
    searching = begun(world, (4, 4), (4, 4), drawing=FIELD)
    assert acts(world, state)[1] == "EXTINGUISH" and Action[acts(world, state)[0]] < 8
    assert Action[acts(world, searching)[0]] < 8


@pytest.mark.parametrize(
    ("target", "move"),
    [((1, 6), "SOUTH"), ((1, 2), "STAY"), ((3, 2), "SOUTH"), ((1, 0), "WEST")],
)
def test_the_first_move_of_a_shortest_way_goes_round_a_lake(target, move):
    env, state = scene("TTT~TTT TTT~TTT TTT~TTT TTTTTTT TTTTTTT", at=[(1, 2)])
    mask = env.world.possible_actions(state)
    assert Action(first_move(state, env.world, mask, torch.tensor([[target]])).item()).name == move
