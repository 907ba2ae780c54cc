"""What all rewards have in common: shaping, shares, checks."""

import math

import pytest
import torch

from tests.conftest import small_world
from tests.env.reward.drawing import EAST, EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl.env.reward import Adaptive, Collaborative, Coverage, Efficiency, Monitor, Paper, Reward, Time
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import Action


def test_shaping_pays_the_way_to_the_fire():
    state, world = drawn(FIELD, [[1, 3]])
    shaped = Efficiency(scale=1.0, shaping=1.0, gamma=0.9, act=0.0)
    # distance 2 -> 1, H = 4: 0.9 x (-0.5 x 1/4) - (-0.5 x 2/4) = 0.1375
    assert earned(shaped, state, world, int(Action.WEST)) == pytest.approx([0.1375])


def test_the_distance_potential_is_nought_where_nothing_burns():
    state, world = drawn(FIELD, [[0, 0]])
    out = world.step(state, torch.tensor([[EXTINGUISH]])).after
    assert count_trees(state).alight.item() == 1 and count_trees(out).alight.item() == 0
    assert Efficiency().phi(state, count_trees(state)).item() < 0.0 == Efficiency().phi(out, count_trees(out)).item()


def test_the_exposure_potential_pays_for_fuel_out_of_reach():
    state, world = drawn(FIELD, [[0, 0]])
    shaped = Efficiency(scale=1.0, shaping=1.0, potential="exposure", gamma=0.9, act=0.0)
    # All 15 trees are within three cells: Phi = -0.5 x 15 / 16; put out, the end, Phi = 0.
    assert earned(shaped, state, world, EXTINGUISH) == pytest.approx([0.9 / 16 + 0.5 * 15 / 16])


@pytest.mark.parametrize("reward", [Efficiency, Time, Coverage, Collaborative, Adaptive, Monitor, Paper])
@pytest.mark.parametrize("potential", ["distance", "exposure"])
def test_shaping_adds_minus_the_first_potential_to_the_return(make_small_env, reward, potential):
    """Sum of gamma^t F = -Phi(s0) for an episode that terminates (Ng, Harada and Russell 1999)."""
    sight = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing") if reward is Monitor else None
    sensing = {} if sight is None else {"sensing": sight.Sight()}
    quick = small_world(fire=Fire(alpha=(0.0, 0.0, 0.0, 1e-6, 0.0)), horizon=400, **sensing)

    def played(weight, gamma):
        """Return the rewards of each step, a list of float32 [B], and the potential at the start."""
        options = {"scale": 1.0, "potential": potential, "team_share": 1.0}
        env = make_small_env(3, quick, reward=reward(shaping=weight, gamma=gamma, **options))
        env.reset()
        first, paid = env.reward_function.phi(env.world_state, env.tree_counts).mean(1) if weight else None, []
        while not env.world_state.done.all():
            action = torch.full((3, 2), EAST)
            now = env.step(env.full_done_spec.zero().set(("agents", "action"), action))["next"]
            paid.append(now["agents", "reward"][:, 0, 0])
        assert now["terminated"].all()
        return paid, first

    plain, _ = played(0.0, 1.0)
    for gamma in (0.9, 1.0) if reward is Efficiency else (0.9,):
        shaped, first = played(1.0, gamma)
        gained = sum(gamma**step * (more - each) for step, (more, each) in enumerate(zip(shaped, plain, strict=True)))
        assert torch.allclose(gained, -first, atol=1e-5)


@pytest.mark.parametrize(("share", "wanted"), [(0.0, [1.0, 0.0]), (0.5, [1.0, 0.5]), (1.0, [1.0, 1.0])])
def test_the_team_s_reward_can_be_the_sum_of_its_agents_own(share, wanted):
    # One of two agents puts a fire out, for 10; the other stays.
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    options = {"shaping": 0.0, "divisor": 10.0, "team_share": share}
    assert earned(Paper(**options, team_reward="sum"), state, world, EXTINGUISH, STAY) == pytest.approx(wanted)
    mean = [1.0 - share + 0.5 * share, 0.5 * share]
    assert earned(Paper(**options), state, world, EXTINGUISH, STAY) == pytest.approx(mean)


@pytest.mark.parametrize("reward", [Efficiency, Time, Coverage, Collaborative, Adaptive, Monitor, Paper])
@pytest.mark.parametrize(
    ("field", "value"), [("team_share", 1.5), ("scale", 0.0), ("shaping", -1.0), ("gamma", float("nan"))]
)
def test_values_out_of_range_are_refused(reward, field, value):
    with pytest.raises(ValueError, match=f"{field} must be in"):
        reward(**{field: value})


@pytest.mark.parametrize(
    ("field", "low", "high"),
    [("team_share", 0.0, 1.0), ("scale", 1e-6, 1e6), ("shaping", 0.0, 1e3), ("gamma", 0.0, 1.0), ("act", -1e9, 1e9)],
)
def test_both_ends_of_a_range_are_taken_and_nothing_beyond(field, low, high):
    assert [getattr(Efficiency(**{field: end}), field) for end in (low, high)] == [low, high]
    for value in (math.nextafter(low, -math.inf), math.nextafter(high, math.inf)):
        with pytest.raises(ValueError, match=f"{field} must be in"):
            Efficiency(**{field: value})


def test_a_reward_must_say_what_an_agent_earns(make_small_env):
    env = make_small_env(1, reward=Reward())
    with pytest.raises(TypeError, match="define own"):
        env.rollout(1)
