"""The reward of agencies, by hand."""

from dataclasses import replace

import pytest
import torch

from tests.conftest import small_world
from tests.env.reward.drawing import CLEAR, EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.reward import Agency
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.mechanics.agencies.agencies import Lands, SeveralAgencies, lands_of
from warp_torchrl.world.state.worth import sums_by

PLAIN = Agency(scale=1.0, shaping=0.0, act=0.0)


def parted(positions, serves):
    """The field with its left half, where the fire is, of agency 0, and its right half of agency 1; 8 trees each."""
    state, world = drawn(FIELD, positions)
    owner = torch.tensor([0, 0, 1, 1], dtype=torch.uint8).expand(1, 4, 4).contiguous()
    worth = sums_by(owner, state.initial.float(), 2)
    state = state.with_planes("agencies", Lands(owner=owner, worth=worth, serves=torch.tensor([serves])))
    return state, replace(world, agencies=SeveralAgencies())


def test_each_earns_for_the_land_that_it_serves():
    # A burning tree is worth nothing, one that was put out 0.9.
    state, world = parted([[0, 1], [3, 3]], [0, 1])
    assert earned(PLAIN, state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 8, 0.0])
    # A tree that was cleared is worth -0.5, after 1.
    assert earned(PLAIN, state, world, STAY, CLEAR) == pytest.approx([0.0, -1.5 / 8])


def test_trees_count_by_their_worth():
    state, world = parted([[0, 1], [3, 3]], [0, 1])
    assets = torch.ones(1, 4, 4)
    assets[0, 1, 1], assets[0, 3, 3] = 9.0, 0.0  # the burning tree, and one of the other agency's
    ground = state.ground.replace(landscape=state.landscape.with_layers(assets=assets))
    lands = lands_of(state).replace(worth=sums_by(lands_of(state).owner, assets * state.initial, 2))
    assert lands.worth.tolist() == [[16.0, 7.0]]
    state = state.replace(ground=ground).with_planes("agencies", lands)
    assert earned(PLAIN, state, world, EXTINGUISH, STAY) == pytest.approx([0.9 * 9 / 16, 0.0])
    assert earned(PLAIN, state, world, STAY, CLEAR) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize(("cooperation", "other"), [(1.0, 0.9 / 8), (0.5, 0.45 / 8), (0.0, 0.0), (-1.0, -0.9 / 8)])
def test_the_other_earns_as_much_of_it_as_they_cooperate(cooperation, other):
    state, world = parted([[0, 1], [3, 3]], [0, 1])
    paid = earned(replace(PLAIN, cooperation=cooperation), state, world, EXTINGUISH, STAY)
    assert paid == pytest.approx([0.9 / 8, other])


def test_whoever_serves_an_agency_earns_what_it_earns():
    state, world = parted([[0, 1], [3, 3]], [1, 0])
    assert earned(PLAIN, state, world, EXTINGUISH, STAY) == pytest.approx([0.0, 0.9 / 8])


def test_a_step_is_paid_by_whom_a_vehicle_served_in_it():
    state, world = parted([[3, 2], [3, 3]], [1, 1])
    world = replace(world, agencies=SeveralAgencies(own=0, lending="need", term=1))
    transition = world.step(state, torch.tensor([[STAY, CLEAR]]))
    assert lands_of(transition.after).serves.tolist() == [[0, 0]], "fire burns on the land of agency 0 alone"
    assert PLAIN(transition)[0, :, 0].tolist() == pytest.approx([-1.5 / 8, -1.5 / 8])


def test_an_act_costs_as_often_as_vehicles_serve_the_agency():
    state, world = parted([[0, 1], [3, 3], [3, 2]], [0, 1, 1])
    own = earned(replace(PLAIN, act=0.01, act_per="forest"), state, world, EXTINGUISH, CLEAR, STAY)
    assert own == pytest.approx([0.9 / 8 - 0.01, -1.5 / 8 - 0.02, -1.5 / 8])


def test_an_act_costs_a_share_of_a_tree_or_of_the_agency_s_land():
    state, world = parted([[0, 1], [3, 3]], [0, 1])
    own = earned(replace(PLAIN, act=0.2), state, world, EXTINGUISH, CLEAR)
    assert own == pytest.approx([0.7 / 8, -1.7 / 8])
    bare = state.with_planes("agencies", lands_of(state).replace(worth=torch.tensor([[8.0, 0.0]])))
    assert earned(replace(PLAIN, act=0.2), bare, world, EXTINGUISH, CLEAR) == pytest.approx([0.7 / 8, 0.0])


def test_of_two_agencies_that_share_each_earns_the_sum_and_of_two_at_odds_they_sum_to_nothing():
    env = make_env("agencies", n_worlds=8, seed=3)
    now = env.reset()
    for _ in range(12):
        before = env.world_state
        now = env.step_mdp(env.rand_step(now))
    for cooperation in (1.0, -1.0):
        transition = env.world.step(before, torch.randint(0, 11, (8, 4)))
        paid = replace(PLAIN, cooperation=cooperation)(transition)[:, [0, 2], 0]
        assert paid.abs().max() > 0.0
        other = paid[:, 1] if cooperation == 1.0 else -paid[:, 1]
        assert torch.allclose(paid[:, 0], other, atol=1e-6)


def test_what_it_needs_is_told_in_one_line():
    with pytest.raises(ConfigError, match=r"^agencies must be several where reward is agency, got one$"):
        make_env("skirmish", n_worlds=1, overrides=["reward=agency"])
    with pytest.raises(
        ConfigError, match=r"^reward.cooperation must be 1 where the team has one value, algorithm.mixer=vdn"
    ):
        run_config(plain(compose_config("train", ["scenario=agencies", "algorithm=vdn"])))
    run_config(plain(compose_config("train", ["scenario=agencies", "algorithm=vdn", "reward.cooperation=1"])))
    with pytest.raises(ValueError, match="agencies must be several"):
        WildfireEnv(small_world(), reward=Agency())
    with pytest.raises(ValueError, match=r"^cooperation must be in \[-1, 1\], got 1.5$"):
        Agency(cooperation=1.5)
    with pytest.raises(ValueError, match=r"^team_share must be 0 in reward=agency"):
        Agency(team_share=0.5)
