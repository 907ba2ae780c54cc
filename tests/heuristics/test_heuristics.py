"""The baselines do what they say, and rank as they should."""

import numpy as np
import pytest
import torch

from tests.conftest import small_world
from tests.heuristics.drawing import chosen, scene
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.evaluation.play import play, play_heuristics
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.base import can_be_put_out, claim_cells, list_cells, nearest_fire
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.arrays.distances import FAR, chebyshev_distance
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.world import World


@pytest.mark.parametrize("name", HEURISTICS)
def test_every_heuristic_acts_within_the_mask_or_does_nothing(make_small_env, name):
    env = make_small_env(5)
    policy = HEURISTICS[name](env)
    now = env.reset()
    for _ in range(8):
        now = policy(now)
        action = now["agents", "action"]
        assert action.dtype == torch.int64 and action.shape == (5, 2)
        assert now["agents", "action_mask"].gather(-1, action[..., None]).all()
        now = env.step(now)["next"]


def test_no_op_without_stay_changes_nothing(make_small_env):
    env = make_small_env(6, small_world(team=Team(n_agents=2, allow_stay=False)))
    episodes = play(env, HEURISTICS["noop"](env), 0)
    assert (episodes["extinguished"] == 0).all() and (episodes["cleared"] == 0).all()


@pytest.mark.parametrize("name", HEURISTICS)
def test_heuristics_repeat_themselves_side_by_side_and_do_the_same_where_masks_are_off(make_small_env, name):
    shown, hidden, again = (
        make_small_env(4, small_world(team=Team(n_agents=2, allow_stay=False), action_masking=each, horizon=8))
        for each in (True, False, False)
    )
    assert hidden.reset()["agents", "action_mask"].all() and not shown.reset()["agents", "action_mask"].all()
    with_masks, without = (play(env, HEURISTICS[name](env), 3) for env in (shown, hidden))
    side_by_side = play_heuristics(again, 3, [name])[name]
    for other in (with_masks, side_by_side):
        assert all((other[metric] == without[metric]).all() for metric in without)


def test_fighters_put_out_a_fire_beside_them(make_small_env):
    env = make_small_env(1)
    now = env.reset()
    state = env.world_state
    fire = (state.cells[0] == 11).nonzero() if (state.cells[0] == 11).any() else (state.cells[0] > 10).nonzero()
    place = fire[0].expand(1, 2, 2).clone()
    now = env.set_state(state.replace(vehicles=state.vehicles.replace(position=place)))
    for name in ("local", "greedy", "coordinated"):
        assert HEURISTICS[name](env)(now)["agents", "action"].tolist() == [[Action.EXTINGUISH] * 2]


def test_the_listed_cells_are_the_marked_ones_in_row_major_order():
    mask = torch.zeros(3, 4, 5, dtype=torch.bool)
    mask[0, 1, 2] = mask[0, 3, 4] = mask[0, 0, 1] = mask[2, 2, 0] = True
    cells, valid = list_cells(mask)
    assert [row[keep].tolist() for row, keep in zip(cells, valid, strict=True)] == [[1, 7, 19], [], [10]]
    assert list_cells(mask[1:2])[1].tolist() == [[False]]


def test_the_nearest_fire_is_the_one_that_a_search_of_the_whole_map_finds():
    env = make_env("default", n_worlds=6)
    env.reset()
    state = env.world_state
    fire = can_be_put_out(state, env.world)
    fire[3] = False
    distance, index = nearest_fire(state, fire)
    everywhere = chebyshev_distance(state.vehicles.position, fire).flatten(2)
    tie_break = uniform(state.key, 0, Stream.POLICY, tuple(everywhere.shape[1:]))
    best = (everywhere + tie_break).min(dim=-1)
    assert (distance == best.values.floor()).all() and (distance[3] == FAR).all()
    burning = fire.flatten(1).any(dim=1)
    assert (index[burning] == best.indices[burning]).all()


def test_agents_to_whom_nothing_is_worth_a_claim_stay(make_small_env):
    env = make_small_env(1)
    env.reset()
    nothing = torch.full((1, 1, 3), -torch.inf)
    claims = claim_cells(env.world_state, torch.tensor([[0, 1, 2]]), nothing, spacing=1, discount=2.0, taken=1.0)
    assert (claims == env.world_state.vehicles.position).all()


def test_coordinated_agents_claim_different_fires():
    env = make_env("default", n_worlds=8)
    env.reset()
    state = env.world_state
    value, front = HEURISTICS["coordinated"](env).value(state)
    cells, valid = list_cells(front)
    worth = value.flatten(1).gather(1, cells).masked_fill(~valid, -torch.inf)[:, None]
    claims = claim_cells(state, cells, worth, spacing=3, discount=6.0, taken=1000.0)
    index = claims[..., 0] * 32 + claims[..., 1]
    for world in range(8):
        assert len(set(index[world].tolist())) == 4
        assert (state.cells[world].flatten()[index[world]] > 10).all()


@pytest.mark.parametrize(("west", "way"), [(9, "SOUTH_WEST"), (10, "SOUTH_EAST")])
def test_a_second_agent_goes_up_to_six_cells_farther_to_a_fire_of_its_own(west, way):
    # Both are 4 cells north of a fire; a second one is 3 east of that, as far away; a third is 9 or 10 west.
    rows = [["T"] * 24 for _ in range(16)]
    rows[8][14] = rows[8][17] = rows[12][14 - west] = "a"
    env, state = scene(" ".join(map("".join, rows)), at=[(4, 14), (4, 14)])
    assert chosen(env, state, "coordinated") == ["SOUTH", way]


def one_fire(team, side=19, steps_per_tick=12, **options):
    """A forest with a fire of 3 x 3 in its middle and the team in a corner."""
    land = Array(cover=np.full((side, side), 3), age=np.full((side, side), 9))
    world = World(
        landscape=land,
        wind=Calm(),
        team=team,
        ignition=Ignition(count=1, region=0.01, head_start=0),
        steps_per_tick=steps_per_tick,
        horizon=240,
        **options,
    )
    return WildfireEnv(world, n_worlds=4, seed=0)


def test_a_ring_is_a_closed_square_that_can_be_finished_in_time():
    env = one_fire(Team(n_agents=4))
    env.reset()
    ring = HEURISTICS["ring"](env)
    ring.choose(env.world_state, env.reset()["agents", "action_mask"])
    fire = env.world_state.cells[0] > 10
    rows = ring._plan[0].nonzero()[:, 0]
    distance = int(rows.max() - fire.nonzero()[:, 0].max())
    assert len(rows) == 4 * (2 + 2 * distance)  # a square of side 3 + 2 d has 4 (2 + 2 d) cells
    # Four agents clear n cells in n / 2 steps, on top of the way there; the front has distance - 1 cells to go.
    assert len(rows) / 2 <= (distance - 1) * 12


def test_a_ring_without_water_stops_a_fire_that_nothing_else_would():
    env = one_fire(Team(n_agents=4, tank=0))
    saved = {name: play(env, HEURISTICS[name](env), 0)["saved"].mean() for name in ("noop", "coordinated", "ring")}
    assert saved["noop"] == saved["coordinated"] < 0.2
    assert saved["ring"] > 0.6


def test_half_of_a_mixed_team_digs():
    team = Team(n_agents=5, roles=("ugv", "uav", "ugv", "ugv", "ugv"))
    env = one_fire(team)
    env.reset()
    assert HEURISTICS["ring"](env).line_builders(env.world_state).tolist() == [True, False, True, True, True]
    assert HEURISTICS["mixed"](env).line_builders(env.world_state).tolist() == [True, False, False, True, False]


@pytest.mark.parametrize("name", ["local", "greedy", "coordinated"])
def test_agents_with_empty_tanks_go_for_water(name):
    env = one_fire(Team(n_agents=1, tank=2))
    now = env.reset()
    state = env.world_state
    base = state.vehicles.base[:, None]
    away = base + torch.where(base > 0, -6, 6)
    tank = torch.zeros_like(state.vehicles.tank)
    policy = HEURISTICS[name](env)
    now = env.set_state(state.replace(vehicles=state.vehicles.replace(position=away, tank=tank)))
    for step in range(6):
        assert (env.world_state.vehicles.tank == 0).all(), step
        now = env.step(policy(now))["next"]
    assert torch.equal(env.world_state.vehicles.position, base)
    assert (env.world_state.vehicles.tank == 2).all()


@pytest.mark.slow
def test_baselines_rank_on_skirmish():
    """16 fires: standard errors of the means are 1 to 5 points, the gaps 10 and more but for two of seven."""
    env = make_env("skirmish", n_worlds=16)
    saved = {name: play(env, HEURISTICS[name](env), 1_000_000)["saved"].mean() for name in HEURISTICS}
    assert saved["noop"] < 0.25
    assert saved["random"] < saved["local"] - 0.2
    assert saved["coordinated"] > saved["local"] + 0.1 and saved["coordinated"] > saved["greedy"] + 0.1
    assert saved["noop"] < saved["ring"] < saved["mixed"] < saved["coordinated"]
