"""Baselines that search act on what their agents know, and on nothing else."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw, knowing
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS, Lawnmower, Oldest
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.state.records import freshness, kept, known_codes
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.places import in_reach
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio
DEAF = Radio(range=0.0)
BLIND = ("local", "oldest", "lawnmower", "greedy", "dispatch")


def forest(size=12, roles=("ugv",), n_agents=2, radius=1, mechanics=(), **team):
    world = small_world(
        landscape=Perlin(size=size, levels=(0.0, 0.0, 0.0)),
        team=Team(n_agents=n_agents, roles=roles, **team),
        sensing=Sight(radius=radius),
        mechanics=mechanics,
        horizon=400,
    )
    return WildfireEnv(world, n_worlds=3, seed=1)


def chosen(env, policy, state):
    env.set_state(state)
    return policy(env.set_state(state))["agents", "action"]


@pytest.mark.parametrize("name", BLIND)
def test_a_fire_that_nobody_knows_of_moves_nobody(name):
    env = forest(mechanics=(DEAF,))
    env.reset()
    policy = HEURISTICS[name](env)
    state = env.world_state.clone()
    unseen = ~in_reach(state, [1, 1]).any(dim=1)
    other = state.replace(cells=torch.where(unseen, 12, state.cells), age=torch.where(unseen, 5, state.age))
    assert torch.equal(chosen(env, policy, state), chosen(env, policy, other))


def with_fire_known(env, place, agent=0):
    """The first state with a tree that burns, which one agent has seen."""
    state = env.world_state.clone()
    cells, knowledge = torch.where(state.cells > 10, 9, state.cells), kept(state).clone()
    cells[:, place[0], place[1]] = 11
    knowledge = torch.where(knowledge % 64 > 10, knowledge - knowledge % 64 + 9, knowledge)
    knowledge[:, agent, place[0], place[1]] = 64 + 11
    return knowing(state, knowledge).replace(cells=cells, age=torch.where(cells > 10, 9, 0).to(torch.uint8))


@pytest.mark.parametrize("name", ["oldest", "lawnmower"])
def test_agents_go_to_the_fire_that_they_remember(name):
    env = forest(start="anywhere", mechanics=(DEAF,))
    env.reset()
    state = with_fire_known(env, (11, 11))
    state.vehicles.position[:] = torch.tensor([[3, 3], [3, 3]])
    assert (chosen(env, HEURISTICS[name](env), state)[:, 0] == Action.SOUTH_EAST).all()
    gone = knowing(state, torch.where(kept(state) % 64 == 11, 64 + 9, kept(state)))
    kept(state)[:, 0, 0, 3] = 64 + 11  # nearer
    assert (chosen(env, HEURISTICS[name](env), state)[:, 0] == Action.NORTH).all()
    assert (known_codes(gone) <= 10).all()


def test_local_remembers_no_fire():
    env = forest(mechanics=(DEAF,))
    env.reset()
    state = with_fire_known(env, (11, 11))
    state.vehicles.position[:] = torch.tensor([[3, 3], [3, 3]])
    nothing = knowing(state, torch.where(kept(state) % 64 == 11, 64 + 9, kept(state)))
    policy = HEURISTICS["local"](env)
    assert torch.equal(chosen(env, policy, state), chosen(env, policy, nothing))


def test_those_that_cannot_extinguish_go_on_searching():
    env = forest(roles=("scout",), start="anywhere")
    env.reset()
    state = with_fire_known(env, (0, 0))
    state.vehicles.position[:] = torch.tensor([[6, 6], [6, 6]])
    nothing = knowing(state, torch.where(kept(state) % 64 == 11, 64 + 9, kept(state)))
    for name in ("oldest", "lawnmower"):
        policy = HEURISTICS[name](env)
        assert torch.equal(chosen(env, policy, state), chosen(env, policy, nothing))


def test_the_oldest_goes_where_it_has_not_looked_for_longest():
    team = Team(n_agents=1)
    world = small_world(landscape=Array(cover=[[3] * 9] * 9), team=team, sensing=Sight(radius=1))
    env = WildfireEnv(world, n_worlds=1)
    state = draw(" ".join(["T" * 9] * 9), team=team, at=[(4, 4)]).replace(step=torch.tensor([300], dtype=torch.int32))
    fresh = torch.full((1, 1, 9, 9), 301 * 64 + 10, dtype=torch.int32)
    for direction, (row, column) in enumerate(DIRECTIONS):
        knowledge = fresh.clone()
        at = 4 + 3 * row, 4 + 3 * column
        knowledge[:, 0, at[0] - 1 : at[0] + 2, at[1] - 1 : at[1] + 2] = 10  # never seen
        target = Oldest(env).search(knowing(state, knowledge))[0, 0]
        assert (target - torch.tensor(at)).abs().max() <= 1, direction


@pytest.mark.parametrize(("n_agents", "radius"), [pytest.param(2, 1, marks=pytest.mark.slow), (3, 2)])
def test_a_lawnmower_sees_the_whole_map_there_and_back(n_agents, radius):
    env = forest(size=15, n_agents=n_agents, radius=radius)
    env.reset()
    state = env.world_state
    env.set_state(state.replace(cells=torch.where(state.cells > 10, 10, state.cells)))
    policy = Lawnmower(env)
    lane = 2 * radius + 1
    length = -(-15 // n_agents) + lane
    passes = 2 * -(-15 // lane) * length + 15  # and the way to its strip
    now = env.set_state(env.world_state)
    for _ in range(passes):
        if env.world_state.terminated.all():
            state = env.world_state
            env.set_state(state.replace(terminated=torch.zeros_like(state.terminated)))
        now = env.step(policy(now))["next"]
    state = env.world_state
    seen = (freshness(kept(state), state.step) > 0).any(dim=1)
    assert seen.all()
