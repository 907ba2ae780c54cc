"""The way to water that agents are told, by hand."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.api.make import make_env
from warp_torchrl.env.observation.water import WATER, way_to_water
from warp_torchrl.models import signature
from warp_torchrl.world.team.supply import where_tanks_fill
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array

NAMES = tuple(name for part in WATER for name in part.names)
FAR_BASE = (63, 63)


def told(lakes, positions, base=FAR_BASE, tank=4, size=64, turned=lambda map: map):
    """What agents at given places are told on a map of trees with lakes at given cells."""
    cover = torch.full((size, size), 3)
    for row, column in lakes:
        cover[row, column] = 0
    team = Team(n_agents=len(positions), start="anywhere", tank=tank)
    world = small_world(landscape=Array(cover=turned(cover).contiguous(), age=torch.full((size, size), 5)), team=team)
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    vehicles = state.vehicles.replace(position=torch.tensor(positions)[None], base=torch.tensor([base]))
    return way_to_water(state.replace(vehicles=vehicles), world)[0]


def test_the_way_to_a_lake_by_hand():
    """Of the nine cells about the lake at (10, 30) the nearest to (20, 33) are (11, 29..31): nine rows to the north."""
    way = told([(10, 30)], [(20, 33)])[0]
    assert way.tolist() == pytest.approx([-3.0 / 9, 1.0, 9 / 32])


def test_the_base_is_water_too_and_a_far_one_is_shown_as_far():
    near, far = told([], [(63, 61), (0, 63)])
    assert near.tolist() == pytest.approx([1.0, 0.0, 2 / 32])
    assert far.tolist() == pytest.approx([0.0, -1.0, 63 / 32])
    assert told([], [(0, 0)], base=(150, 150), size=160)[0, 2] == 3.0


def test_of_waters_that_are_as_near_none_is_preferred():
    way = told([(20, 10), (20, 30)], [(20, 20)])[0]
    assert way.tolist() == pytest.approx([0.0, 0.0, 9 / 32])


def test_it_turns_with_the_map():
    before = told([(10, 30), (50, 3)], [(20, 33), (40, 12)])
    places = [(33, 63 - 20), (12, 63 - 40)]  # a quarter clockwise: (row, column) comes to (column, 63 - row)
    after = told([(10, 30), (50, 3)], places, (63, 0), turned=lambda map: map.rot90(-1))
    assert torch.allclose(after[:, 0], before[:, 1]) and torch.allclose(after[:, 1], -before[:, 0])
    assert torch.equal(after[:, 2], before[:, 2])


def test_teams_that_need_no_water_are_told_zeros():
    for tank in (None, 0):
        assert not told([(10, 30)], [(20, 33), (11, 30)], tank=tank).any()


def test_a_tank_fills_where_the_way_to_water_ends_and_nowhere_else():
    env = make_env("water", n_worlds=16, overrides=["team.tank=500", "horizon=64", "landscape.size=16"])
    shown, filled, elsewhere = env.reset(), 0, 0
    for _ in range(40):
        state = env.world_state
        vehicles = state.vehicles.replace(tank=torch.full_like(state.vehicles.tank, 100))
        shown = env.set_state(state.replace(vehicles=vehicles))
        shown = env.step(env.rand_action(shown))["next"]
        now = env.world_state
        is_there = way_to_water(now, env.world)[..., 2] == 0.0
        place = now.vehicles.position
        assert torch.equal(is_there, where_tanks_fill(now)[torch.arange(16)[:, None], place[..., 0], place[..., 1]])
        running = ~shown["done"]
        assert torch.equal((now.vehicles.tank == 500) & running, is_there & running)
        filled, elsewhere = filled + int((is_there & running).sum()), elsewhere + int((~is_there & running).sum())
    assert filled > 100 and elsewhere > 100


def test_it_is_told_on_request_alone_after_the_rules():
    def told_of(*overrides):
        return signature(make_env("water", n_worlds=1, overrides=["observation=surroundings", *overrides])).observation[
            "status"
        ]

    assert told_of("observation.water=true").names == (*told_of().names, *NAMES)
    both = told_of("observation.water=true", "observation.rules=true")
    assert both.names == (*told_of("observation.rules=true").names, *NAMES) and both.symmetry.parts[-2:] == WATER


def test_an_agent_is_shown_what_is_told():
    env = make_env("water", n_worlds=3, overrides=["observation=surroundings", "observation.water=true"])
    own = env.reset()["agents", "observation", "status"]
    assert torch.equal(own[..., -3:], way_to_water(env.world_state, env.world)) and own[..., -1].any()
