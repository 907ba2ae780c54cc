"""What teams earn, worked out by hand."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.reward import Efficiency, Paper, Reward
from warp_torchrl.world.array import Array
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.state import Action, count_trees
from warp_torchrl.world.team import Team

STAY, CLEAR, EXTINGUISH, EAST = int(Action.STAY), int(Action.CLEAR), int(Action.EXTINGUISH), int(Action.EAST)


def drawn(rows, positions, *, steps_per_tick=1000, fire=None):
    """A forest world drawn as text: T a tree of age 5, F a fire in its first stage, ~ a lake."""
    codes = torch.tensor([[{"T": 5, "F": 11, "~": 0}[each] for each in row] for row in rows], dtype=torch.uint8)[None]
    cover = torch.tensor([[0 if each == "~" else 3 for each in row] for row in rows])
    land = Array(cover=cover, age=torch.full(cover.shape, 5))
    world = small_world(
        landscape=land,
        team=Team(n_agents=len(positions), start="anywhere"),
        steps_per_tick=steps_per_tick,
        fire=fire or Fire(),
    )
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    state = state.replace(
        cells=codes,
        age=torch.where(codes == 11, 5, 0).to(torch.uint8),
        burned=torch.zeros_like(state.burned),
        vehicles=state.vehicles.replace(position=torch.tensor(positions)[None]),
    )
    return state.replace(tally=count_trees(state)), world


def earned(reward, state, world, *actions):
    return reward(world.step(state, torch.tensor([actions])))[0, :, 0].tolist()


FIELD = ["TTTT", "TFTT", "TTTT", "TTTT"]  # 16 trees, one of them burning


def test_efficiency_pays_a_put_out_tree_and_charges_the_act():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # Q rises by w_e / N0 = 0.9 / 16; one act costs the team's mean 5e-4
    assert earned(Efficiency(), state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16 - 5e-4] * 2)


def test_efficiency_charges_a_cleared_tree():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # a preserved tree (1) becomes a cleared one (-0.5)
    assert earned(Efficiency(), state, world, STAY, CLEAR) == pytest.approx([-1.5 / 16 - 5e-4] * 2)


def test_efficiency_charges_the_tick_that_ignites():
    state, world = drawn(
        FIELD,
        [[3, 3]],
        steps_per_tick=1,
        fire=Fire(alpha=(0, 0, 0, 1.0, 0), diagonal="unit", wind_gain=0.0, wind_focus=0.0),
    )
    assert earned(Efficiency(), state, world, STAY) == pytest.approx([-8 / 16])  # all eight neighbours catch fire


def test_own_share_makes_each_agent_pay_for_its_own_acts():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    first, second = earned(Efficiency(team_share=0.0, act=0.01), state, world, EXTINGUISH, STAY)
    assert first == pytest.approx(0.9 / 16 - 0.02) and second == pytest.approx(0.9 / 16)
    mixed = earned(Efficiency(team_share=0.5, act=0.01), state, world, EXTINGUISH, STAY)
    assert mixed == pytest.approx([0.9 / 16 - 0.015, 0.9 / 16 - 0.005])


def test_efficiency_telescopes_to_its_closed_form(make_small_env):
    reward = Efficiency()
    env = make_small_env(6, small_world(horizon=60), reward=reward)
    env.reset()
    start = reward._worth(env.world_state.tally)
    rollout = env.rollout(60, break_when_any_done=False, auto_reset=False, tensordict=env.set_state(env.world_state))
    ended = rollout["next", "done"][:, :, 0].to(torch.int64).argmax(1)
    for world in range(6):
        total = rollout["next", "agents", "reward"][world, : ended[world] + 1, 0].sum()
        info = rollout["next", "info"][world, ended[world]]
        worth = info["saved"] - 0.1 * info["extinguished"] - 0.5 * info["cleared"] - info["burned"]
        acts = info["actions"] * info["episode_length"] * 2
        assert total == pytest.approx((worth - start[world] - 5e-4 * acts).item(), abs=1e-5)


def test_shaping_pays_the_way_to_the_fire():
    state, world = drawn(FIELD, [[1, 3]])
    shaped = Efficiency(shaping=1.0, gamma=0.9, act=0.0)
    # distance 2 -> 1, H = 4: 0.9 x (-0.5 x 1/4) - (-0.5 x 2/4) = 0.1375
    assert earned(shaped, state, world, int(Action.WEST)) == pytest.approx([0.1375])


@pytest.mark.parametrize("gamma", [0.9, 1.0])
def test_shaping_adds_minus_the_first_potential_to_the_return(make_small_env, gamma):
    """Sum of gamma^t F = -Phi(s0) for an episode that terminates (Ng, Harada and Russell 1999)."""
    quick = small_world(fire=Fire(alpha=(0.0, 0.0, 0.0, 1e-6, 0.0)), horizon=400)
    returns = []
    for weight in (0.0, 1.0):
        env = make_small_env(3, quick, reward=Efficiency(shaping=weight, gamma=gamma))
        env.reset()
        if weight:
            from warp_torchrl.reward import _distance_potential

            potential = _distance_potential(env.world_state).mean(1)
        total, discount = 0.0, 1.0
        for _ in range(30):
            action = torch.full((3, 2), EAST)
            now = env.step(env.full_done_spec.zero().set(("agents", "action"), action))["next"]
            total = total + discount * now["agents", "reward"][:, 0, 0]
            discount *= gamma
        assert now["terminated"].all()
        returns.append(total)
    assert torch.allclose(returns[1] - returns[0], -potential, atol=1e-5)


def test_the_paper_reward_by_hand():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    assert earned(Paper(team_share=0.0), state, world, EXTINGUISH, EAST) == pytest.approx([10 / 50, -0.2 / 50])
    assert earned(Paper(team_share=0.0), state, world, STAY, EXTINGUISH) == pytest.approx([0, -1 / 50])


def test_the_paper_reward_charges_clearing_far_from_fire():
    state, world = drawn(["FTTTTT", *["TTTTTT"] * 5], [[5, 5]])
    assert earned(Paper(), state, world, CLEAR) == pytest.approx([(1 - 2) / 50])


def test_the_barrier_pays_what_it_cuts_off_and_the_printed_one_pays_any_clearing():
    rows = ["TTT~TTT", "TFT~TTT", "TTTTTTT", "~~~~TTT"]
    # The only bridge is row 2, column 3: clearing it cuts the right hand side's 3 + 3 + 3 + 3 = 12 trees off. The
    # diagonal does not pass: (2, 2) and (3, 4) or (1, 4) are two columns apart.
    state, world = drawn(rows, [[2, 3]])
    initial = 9 + 1 + 12  # left block, bridge, right block; the fire is one of the left ones
    cut = earned(Paper(), state, world, CLEAR)[0]
    assert state.tally.initial.item() == initial
    assert cut == pytest.approx((1 + 50 * 12 / initial) / 50)
    elsewhere, _ = drawn(rows, [[0, 0]])
    assert earned(Paper(), elsewhere, world, CLEAR) == pytest.approx([1 / 50])
    assert earned(Paper(barrier_rule="printed"), elsewhere, world, CLEAR) == pytest.approx([51 / 50])


@pytest.mark.parametrize("reward", [Efficiency, Paper])
@pytest.mark.parametrize(
    ("field", "value"), [("team_share", 1.5), ("scale", 0.0), ("shaping", -1.0), ("gamma", float("nan"))]
)
def test_values_out_of_range_are_refused(reward, field, value):
    with pytest.raises(ValueError, match=f"{field} must be in"):
        reward(**{field: value})


def test_a_reward_must_say_what_an_agent_earns(make_small_env):
    env = make_small_env(1, reward=Reward())
    with pytest.raises(TypeError, match="define own"):
        env.rollout(1)
