"""Baselines act on what their agents know, by hand; a follower watches the known front."""

import numpy as np
import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import knowing
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.evaluation.play import play
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.heuristic import instructor
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.arrays.distances import chebyshev_distance
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.state.records import kept
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.world import World

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio


@pytest.mark.parametrize("name", HEURISTICS)
def test_a_fire_that_no_agent_sees_moves_teachers_alone(make_small_env, name):
    env = make_small_env(16, small_world(sensing=Sight(radius=1), team=Team(n_agents=2, start="anywhere")))
    env.reset()
    state, vehicles = env.world_state, env.world_state.vehicles
    trees = torch.full_like(state.cells, 5)
    unseen = chebyshev_distance(vehicles.position, trees > 0).amin(dim=1) > 1
    burns = unseen & (torch.rand(trees.shape, generator=torch.Generator().manual_seed(0)) < 0.5)
    vehicles = vehicles.replace(acts=torch.ones_like(vehicles.acts))  # all have been at the fire
    states = [state.replace(cells=each, vehicles=vehicles) for each in (trees, trees.masked_fill(burns, 11))]
    masks = [env.world.possible_actions(each) for each in states]
    assert torch.equal(*(HEURISTICS[name](env).act(*each) for each in zip(states, masks, strict=True)))
    acts = [instructor(HEURISTICS[name], env).act(*each) for each in zip(states, masks, strict=True)]
    assert torch.equal(*acts) != HEURISTICS[name].reads_map


def watched_forest(team, *mechanics, side=19):
    """A forest of trees in calm air, and a team that knows what it saw."""
    land = Array(cover=np.full((side, side), 3), age=np.full((side, side), 9))
    ignition = Ignition(count=1, region=0.01, head_start=0)
    world = World(
        landscape=land, wind=Calm(), team=team, ignition=ignition, sensing=Sight(radius=2), mechanics=mechanics
    )
    return WildfireEnv(world, n_worlds=1, seed=0)


def told(env, at, *, fires, step=40, heard_at=None, name="follower"):
    """What agents at places do at a step, who all know of fires, (row, column): when they were seen.

    Where packets come late, those arrive that were sent at the places ``heard_at``.
    """
    env.reset()
    state = env.world_state
    knowledge = state.landscape.age.to(torch.int32)[:, None].expand_as(kept(state)) + 64 * (step + 1)
    for (row, column), seen in fires.items():
        knowledge[..., row, column] = (1 + seen) * 64 + 11
    vehicles = state.vehicles.replace(position=torch.tensor([at]))
    if heard_at is not None:
        packets = state.extras.held["radio"]
        places = torch.tensor([heard_at]).expand_as(packets.places)
        others = ~torch.eye(len(at), dtype=torch.bool)
        packets = packets.replace(links=others.expand_as(packets.links), places=places)
        state = state.with_planes("radio", packets)
    state = knowing(state, knowledge).replace(vehicles=vehicles, step=torch.full_like(state.step, step))
    now = env.set_state(state)
    return HEURISTICS[name](env)(now)["agents", "action"][0].tolist()


def test_a_targeted_watcher_goes_where_the_next_tick_is_uncertain_and_waits_there():
    env = watched_forest(Team(n_agents=1, roles=("scout",)))
    fires = {(9, 3): 40}
    assert told(env, [[9, 9]], fires=fires, name="targeted")[0] in (Action.WEST, Action.NORTH_WEST, Action.SOUTH_WEST)
    assert told(env, [[9, 3]], fires=fires, name="targeted") == [Action.STAY]


def test_targeted_watchers_part():
    env = watched_forest(Team(n_agents=2, roles=("scout",)))
    moves = told(env, [[9, 9], [9, 9]], fires={(9, 3): 40, (9, 16): 40}, name="targeted")
    west, east = (
        {Action.WEST, Action.NORTH_WEST, Action.SOUTH_WEST},
        {Action.EAST, Action.NORTH_EAST, Action.SOUTH_EAST},
    )
    assert {*moves} & west and {*moves} & east


def test_a_follower_goes_to_the_front_that_it_saw_longest_ago():
    env = watched_forest(Team(n_agents=1, roles=("scout",)))
    assert told(env, [[9, 9]], fires={(9, 3): 30, (3, 9): 20}) == [Action.NORTH]
    assert told(env, [[9, 9]], fires={(9, 3): 20, (3, 9): 30}) == [Action.WEST]
    # Seen 10 steps ago and 9 moves away, or seen 5 steps ago and 1 move away.
    assert told(env, [[9, 0]], fires={(9, 18): 30, (7, 0): 35}) == [Action.NORTH]


def test_followers_leave_to_each_other_what_is_nearer_to_them():
    env = watched_forest(Team(n_agents=2, roles=("scout",)))
    at = [[9, 2], [9, 16]]
    assert told(env, at, fires={(3, 2): 10, (15, 16): 30}) == [Action.NORTH, Action.SOUTH]
    deaf = watched_forest(Team(n_agents=2, roles=("scout",)), Radio(range=0.0))
    assert told(deaf, at, fires={(3, 2): 5, (15, 16): 30}) == [Action.NORTH, Action.NORTH_WEST], "it knows of no other"
    late = watched_forest(Team(n_agents=2, roles=("scout",)), Radio(delay=1))
    assert told(late, at, fires={(3, 2): 5, (15, 16): 30}) == [Action.NORTH, Action.NORTH_WEST], "nothing has come yet"
    found = told(late, at, fires={(3, 2): 10, (15, 16): 30}, heard_at=[[15, 16], [9, 16]])
    assert found == [Action.NORTH, Action.NORTH_WEST], "the other was there when it spoke"


def test_a_follower_that_knows_of_no_fire_searches_and_one_that_could_put_it_out_does_not():
    env = watched_forest(Team(n_agents=2, roles=("uav",)))
    now = env.reset()
    assert not (kept(env.world_state) % 16 > 10).any()
    choices = [HEURISTICS[name](env)(now)["agents", "action"].tolist() for name in ("follower", "oldest")]
    assert choices[0] == choices[1]
    assert told(env, [[9, 9], [9, 9]], fires={(9, 9): 40, (3, 9): 20}) == [Action.NORTH, Action.NORTH]


@pytest.mark.slow
def test_followers_watch_more_than_searchers_and_idlers_of_front():
    """8 fires: standard errors of the means are under 4 points, the gaps over 25."""
    env = make_env("front", n_worlds=8, overrides=["horizon=128"])
    watched = {
        name: play(env, HEURISTICS[name](env), 1_000_000)["watched"].mean() for name in ("noop", "oldest", "follower")
    }
    assert watched["noop"] < 0.1 < watched["oldest"] - 0.1 and watched["oldest"] + 0.15 < watched["follower"]
