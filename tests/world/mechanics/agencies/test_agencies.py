"""Agencies: lands, who starts where, and who is lent to whom."""

import math
from dataclasses import replace

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw
from warp_torchrl import make_env
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.agencies.agencies import (
    Lands,
    SeveralAgencies,
    apportioned,
    lands_of,
    own_land,
    standing,
)
from warp_torchrl.world.mechanics.groups import OneAgency
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Action, Cover
from warp_torchrl.world.state.worth import sums_by, worth_of
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

WORLD = small_world()


def begun(n_agents=4, seeds=8, **options):
    world = small_world(team=Team(n_agents=n_agents), agencies=SeveralAgencies(**options))
    seed = torch.arange(seeds)
    return world, world.reset(seed, torch.zeros_like(seed))


def parted(drawing, owner, serves, at=None):
    """A drawn world whose cells are of the agencies by number, 0 1 ..., and whose vehicles serve those given."""
    team = Team(n_agents=len(serves), start="anywhere")
    state = draw(drawing, team=team, at=at)
    owner = torch.tensor([[int(cell) for cell in row] for row in owner.split()], dtype=torch.uint8)[None]
    agencies = int(owner.max()) + 1
    worth = sums_by(owner, worth_of(state) * state.initial, agencies)
    return state.with_planes("agencies", Lands(owner=owner, worth=worth, serves=torch.tensor([serves])))


@pytest.mark.parametrize("count", [2, 3, 5])
def test_land_is_parted_into_equal_sectors_in_a_direction_of_the_episode(count):
    _, state = begun(n_agents=5, seeds=64, count=count)
    owner = lands_of(state).owner
    shares = torch.stack([(owner == agency).float().mean((1, 2)) for agency in range(count)], dim=1)
    assert torch.allclose(shares.sum(1), torch.ones(64)) and (shares - 1.0 / count).abs().max() < 0.1
    assert len({tuple(each.flatten().tolist()) for each in owner}) > 40, "each episode draws its own"
    # Of two agencies each has what is opposite to the other's.
    if count == 2:
        assert (owner + owner.flip(1, 2) == 1).all()


def test_a_world_is_parted_alike_in_any_batch():
    world, state = begun(seeds=8)
    alone = world.reset(torch.tensor([5]), torch.tensor([0]))
    assert torch.equal(lands_of(alone).owner[0], lands_of(state).owner[5])
    assert torch.equal(alone.vehicles.position[0], state.vehicles.position[5])


def test_vehicles_start_on_dry_land_of_those_they_serve_and_no_two_on_one_cell():
    world, state = begun(n_agents=6, seeds=32, own=2)
    assert lands_of(state).serves[0].tolist() == [0, 0, 1, 1, 0, 1]
    index = state.vehicles.position[..., 0] * 12 + state.vehicles.position[..., 1]
    on_own = own_land(state).flatten(2).gather(2, index[..., None])[..., 0]
    assert on_own.all() and all(len(set(each.tolist())) == 6 for each in index)
    assert (state.cover.flatten(1).gather(1, index) != int(Cover.LAKE)).all()
    assert not is_burning(state.cells).flatten(1).gather(1, index).any()
    anywhere = replace(world, team=replace(world.team, start="anywhere"))
    other = anywhere.reset(torch.arange(32), torch.zeros(32, dtype=torch.int64))
    assert not torch.equal(other.vehicles.position, state.vehicles.position)
    assert torch.equal(lands_of(other).owner, lands_of(state).owner)


def test_a_vehicle_stands_at_home_in_the_middle_of_its_agency_s_land():
    world = small_world(landscape=Perlin(size=17, levels=(0.0, 0.0, 0.0)), agencies=SeveralAgencies())
    state = world.reset(torch.arange(16), torch.zeros(16, dtype=torch.int64))
    angle = 2.0 * math.pi * (uniform(state.key, 0, Stream.LANDS, (1,)) + torch.tensor([0.0, 0.5]))
    home = torch.stack((8 + 0.35 * 17 * angle.sin(), 8 + 0.35 * 17 * angle.cos()), dim=-1).round().long()
    lit = is_burning(state.cells).flatten(1).gather(1, home[..., 0] * 17 + home[..., 1])
    assert torch.equal(state.vehicles.position[~lit], home[~lit]) and (~lit).sum() > 24


def test_worth_is_that_of_the_trees_of_each_land_before_the_fire():
    state = parted("T.a T5T", "001 011", [0, 1])
    assert lands_of(state).worth.tolist() == [[2.0, 3.0]]
    assert standing(state).tolist() == [[1.0, pytest.approx(2 / 3)]]
    landscape = state.landscape.with_layers(assets=torch.tensor([[[4.0, 9.0, 1.0], [1.0, 1.0, 2.0]]]))
    state = state.replace(ground=state.ground.replace(landscape=landscape))
    worth = sums_by(lands_of(state).owner, worth_of(state) * state.initial, 2)
    assert worth.tolist() == [[5.0, 4.0]]
    state = state.with_planes("agencies", lands_of(state).replace(worth=worth))
    assert standing(state).tolist() == [[1.0, 0.75]]


def test_a_tree_that_grew_on_ash_is_lost_all_the_same():
    state = parted("T6. T..", "001 011", [0, 1])
    burned = torch.tensor([[[False, True, False], [False, False, False]]])
    assert standing(state.replace(burned=burned)).tolist()[0] == [pytest.approx(2 / 3), 1.0]


def test_an_agency_without_trees_has_lost_nothing():
    assert standing(parted("T.a ...", "001 111", [0])).tolist()[0] == [1.0, 0.0]
    assert standing(parted("T.. ...", "001 111", [0])).tolist()[0] == [1.0, 1.0]


@pytest.mark.parametrize(
    ("need", "expected"),
    [
        (
            [3.0, 1.0],
            [0, 0, 0, 1],
        ),  # 3, 1.5, 1 | 1: the last two are equal, and the first of equals is the first agency
        ([1.0, 1.0], [0, 0, 1, 1]),
        ([0.0, 2.0], [1, 1, 1, 1]),
        ([100.0, 39.0], [0, 0, 0, 1]),  # 100, 50, 39, 33.3
        ([2.0, 0.0, 1.9], [0, 0, 2, 2]),
    ],
)
def test_vehicles_are_apportioned_by_d_hondt(need, expected):
    assert apportioned(torch.tensor([need, need]), 4).tolist() == [expected, expected]


def test_divisors_are_one_two_three_which_favour_the_large():
    # 100, 50, 33.3, 25 | 80, 40, 26.7 | 30: by odd divisors (Sainte-Lague) it would be 3, 3, 1, 1.
    need = torch.tensor([[100.0, 80.0, 30.0, 20.0]])
    assert apportioned(need, 8).tolist() == [[0, 0, 0, 0, 1, 1, 1, 2]]


def test_the_pool_is_lent_by_need_when_a_term_is_over():
    agencies = SeveralAgencies(own=1, lending="need", term=4)
    state = parted("a.T.b ..T.c", "00011 00011", [0, 1, 0, 1])
    running = torch.tensor([True])

    def lent(step, **changes):
        now = state.replace(step=torch.tensor([step], dtype=torch.int32), **changes)
        return lands_of(agencies.step(now, now, running, WORLD)).serves[0].tolist()

    assert lent(4) == [0, 1, 0, 1]  # one burns against two: 2, 1 | 1
    assert lent(4, cells=torch.where(lands_of(state).owner == 0, 0, state.cells)) == [0, 1, 1, 1]
    assert lent(5, cells=torch.where(lands_of(state).owner == 0, 0, state.cells)) == [0, 1, 0, 1], "within a term"
    assert lent(4, cells=torch.zeros_like(state.cells)) == [0, 1, 0, 1], "nothing burns"
    fixed = replace(agencies, lending="fixed")
    now = state.replace(step=torch.tensor([4]), cells=torch.where(lands_of(state).owner == 0, 0, state.cells))
    assert lands_of(fixed.step(now, now, running, WORLD)).serves[0].tolist() == [0, 1, 0, 1]
    assert lands_of(agencies.step(now, now, torch.tensor([False]), WORLD)).serves[0].tolist() == [0, 1, 0, 1], (
        "it has ended"
    )


def test_a_world_lends_as_it_steps():
    world = small_world(team=Team(n_agents=3), agencies=SeveralAgencies(own=0, lending="need", term=2))
    state = world.reset(torch.arange(16), torch.zeros(16, dtype=torch.int64))
    for _ in range(2):
        state = world.step(state, torch.full((16, 3), int(Action.STAY))).after
    burning = sums_by(lands_of(state).owner, is_burning(state.cells).float(), 2)
    one_sided = (burning == 0).any(dim=1) & (burning > 0).any(dim=1)
    assert one_sided.any()
    assert (lands_of(state).serves[one_sided] == burning[one_sided].argmax(1, keepdim=True)).all()


def test_groups_are_the_agencies_and_the_pool():
    assert SeveralAgencies().groups(Team(n_agents=5)) == {"agency_0": [0, 1], "agency_1": [2, 3], "pool": [4]}
    assert SeveralAgencies(count=3, own=0).groups(Team(n_agents=2)) == {"pool": [0, 1]}
    assert OneAgency().groups(Team(n_agents=2)) == {"agents": [0, 1]}


def test_a_team_that_is_too_small_is_refused_in_one_line():
    with pytest.raises(
        ConfigError, match=r"^team.n_agents must be at least 4, the vehicles that 2 agencies own, got 3$"
    ):
        make_env("agencies", n_worlds=1, overrides=["team.n_agents=3", "agencies.own=2"])
    with pytest.raises(ValueError, match="at least 2, the vehicles that 2 agencies own, got 1"):
        small_world(team=Team(n_agents=1), agencies=SeveralAgencies())


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("count", 1), ("count", 17), ("own", -1), ("own", 257), ("term", 0), ("term", 1_000_001), ("lending", "needs")],
)
def test_what_cannot_be_is_refused(name, wrong):
    with pytest.raises(ValueError, match=rf"^{name} must be .*, got '?{wrong}"):
        SeveralAgencies(**{name: wrong})
