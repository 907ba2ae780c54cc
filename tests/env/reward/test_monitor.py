"""The reward for watching, by hand."""

from dataclasses import replace

import pytest

from tests.conftest import small_world
from tests.env.reward.drawing import FIELD, STAY, drawn, earned
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.reward import Monitor
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team

Sight = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing").Sight
PLAIN = Monitor(scale=1.0)


def watched(rows, positions):
    """A drawn world whose agents see one cell far."""
    state, world = drawn(rows, positions)
    world = replace(world, sensing=Sight(radius=1))
    return world.sensing.begin(state, world), world


def test_who_watches_the_front_is_paid_for_its_share():
    state, world = watched(FIELD, [[0, 0], [3, 3]])
    # The first sees the one burning cell; two agents, each paid twice for its own.
    assert earned(PLAIN, state, world, STAY, STAY) == pytest.approx([2 * 0.02, 0.0])
    assert earned(replace(PLAIN, team_share=1.0), state, world, STAY, STAY) == pytest.approx([0.02, 0.02])


def test_who_finds_fire_is_paid_and_less_uncertainty_is_everybodys():
    state, world = watched(FIELD, [[3, 3], [3, 0]])
    # Each saw four of 16 cells. The first then sees nine, two of them the other's: 11 in all.
    drop = (11 - 8) / 16
    paid = earned(PLAIN, state, world, int(Action.NORTH_WEST), STAY)
    assert paid == pytest.approx([2 * (0.02 + 0.1) + 0.5 * drop, 0.5 * drop])
    only = Monitor(scale=1.0, watched=0.0, uncertainty=0.0, found=1.0)
    assert earned(only, state, world, int(Action.NORTH_WEST), STAY) == pytest.approx([2.0, 0.0])


def test_near_misses_cost_those_who_have_them():
    flight = pytest.importorskip("warp_torchrl.world.mechanics.flight.flight")
    state, world = drawn(FIELD, [[3, 2], [3, 3]])
    team = Team(n_agents=2, roles=("scout",), start="anywhere")
    world = replace(world, sensing=Sight(radius=1), team=team, mechanics=(flight.Flight(separation=2.0),))
    for each in world.loop:
        state = each.begin(state, world)
    assert earned(Monitor(scale=1.0, near_miss=0.5), state, world, STAY, STAY) == pytest.approx([-1.0, -1.0])
    # The first flies two cells north, sqrt(5) away from the second, which sees no fire.
    free = Monitor(scale=1.0, near_miss=0.5, uncertainty=0.0)
    assert earned(free, state, world, int(Action.NORTH), STAY)[1] == pytest.approx(0.0)


def test_it_needs_agents_whose_sight_is_limited():
    with pytest.raises(ConfigError, match=r"^sensing must be sight where reward is monitor"):
        make_env("skirmish", n_worlds=1, overrides=["reward=monitor"])
    with pytest.raises(ValueError, match="sensing must be sight where reward is monitor"):
        WildfireEnv(small_world(), reward=Monitor())
    env = make_env("skirmish", n_worlds=1, overrides=["reward=monitor", "sensing=sight"])
    assert isinstance(env.reward_function, Monitor)


def test_a_negative_weight_is_refused():
    for name in ("watched", "found", "uncertainty", "near_miss"):
        with pytest.raises(ValueError, match=f"{name} must be in"):
            Monitor(**{name: -1.0})
