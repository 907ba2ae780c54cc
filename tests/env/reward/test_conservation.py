"""The five conservation rewards, worked out by hand, and their closed forms."""

from functools import partial

import numpy as np
import pytest
import torch

from tests.conftest import small_world
from tests.env.reward.drawing import CLEAR, EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl.env import reward as rewards
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.terrain.landscape import Perlin

SURE = Fire(alpha=(0, 0, 0, 1.0, 0), diagonal="unit", wind_gain=0.0, wind_focus=0.0)
Efficiency, Time, Coverage, Collaborative, Adaptive = (
    partial(each, scale=1.0, shaping=0.0)
    for each in (rewards.Efficiency, rewards.Time, rewards.Coverage, rewards.Collaborative, rewards.Adaptive)
)
CONSERVATION = [Efficiency, Time, Coverage, Collaborative, Adaptive]


def test_efficiency_pays_a_put_out_tree_and_charges_the_act():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # Q rises by w_e / N0 = 0.9 / 16; one act costs the team's mean a tenth of a tree, and all of that is the actor's
    assert earned(Efficiency(), state, world, EXTINGUISH, STAY) == pytest.approx([0.7 / 16, 0.9 / 16])
    assert earned(Efficiency(team_share=1.0), state, world, EXTINGUISH, STAY) == pytest.approx([0.8 / 16] * 2)


def test_the_first_reward_alone_charges_for_acts():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    for reward in CONSERVATION:
        charged = 0.0 if reward is not Efficiency else 0.1
        wanted = earned(reward(act=charged), state, world, EXTINGUISH, STAY)
        assert earned(reward(), state, world, EXTINGUISH, STAY) == wanted
    free = earned(Efficiency(act=0.0), state, world, EXTINGUISH, STAY)
    assert free == pytest.approx([0.9 / 16] * 2)


def test_an_act_may_cost_a_share_of_the_forest():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    dear = Efficiency(act=5e-4, act_per="forest")
    assert earned(dear, state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16 - 1e-3, 0.9 / 16])


def test_efficiency_charges_a_cleared_tree():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # a preserved tree (1) becomes a cleared one (-0.5)
    assert earned(Efficiency(), state, world, STAY, CLEAR) == pytest.approx([-1.5 / 16, -1.7 / 16])


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
    first, second = earned(Efficiency(team_share=0.0, act=0.2), state, world, EXTINGUISH, STAY)
    assert first == pytest.approx(0.5 / 16) and second == pytest.approx(0.9 / 16)
    mixed = earned(Efficiency(team_share=0.5, act=0.2), state, world, EXTINGUISH, STAY)
    assert mixed == pytest.approx([0.6 / 16, 0.8 / 16])


def test_time_charges_every_step_its_share_of_the_horizon():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # Put out: 0.9 / 16; a step of 50: 0.2 / 50 = 0.004.
    assert earned(Time(horizon=50), state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16 - 0.004] * 2)
    assert earned(Time(horizon=50), state, world, STAY, STAY) == pytest.approx([-0.004] * 2, abs=1e-7)


def test_time_as_printed_pays_once_at_the_end_and_likes_it_late():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    printed = Time(rule="printed", horizon=50)
    assert earned(printed, state, world, STAY, STAY) == [0.0, 0.0]
    assert earned(printed, state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16 - 0.2] * 2)  # after one step
    later = state.replace(step=torch.tensor([9], dtype=torch.int32))
    assert earned(printed, later, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16 - 0.02] * 2)  # after ten


BLOCKS = ["T" * 16, "TFTTTTTTTTTTTTTT", *["T" * 16] * 6]  # two blocks of 8 x 8, fire in the left one


def test_coverage_charges_a_block_from_which_too_much_burns():
    state, world = drawn(BLOCKS, [[7, 15]], steps_per_tick=1, fire=SURE)
    # 1 of 64 trees burns, 1.6 %: the block is spared. After the tick 9 of 64: it is lost. Q falls by 8 / 128.
    assert Coverage().value(state, count_trees(state)).item() == pytest.approx(127 / 128 + 0.04)
    assert earned(Coverage(), state, world, STAY) == pytest.approx([-8 / 128 - 0.02])


def test_coverage_weighs_blocks_by_their_assets():
    state, world = drawn(BLOCKS, [[7, 15]], steps_per_tick=1, fire=SURE)
    # The left block is worth three times the right one: 1.5 and 0.5 of the mean.
    assets = torch.tensor(np.repeat([3.0, 1.0], 8), dtype=torch.float32).expand(1, 8, 16)
    state = state.replace(ground=state.ground.replace(landscape=state.landscape.with_layers(assets=assets)))
    assert earned(Coverage(), state, world, STAY) == pytest.approx([-8 / 128 - 0.03])


def test_assets_are_weighed_by_the_mean_of_the_whole_map_of_each_world():
    # Four blocks of 8 x 8 worth 1, 2, 3 and 6, of mean 3: weights 1/3, 2/3, 1, 2; another world is worth ten times as
    # much. Fire in the first block, 8 of 64 trees, loses its third: 0.02 x (2/3 + 1 + 2) in both worlds.
    rows = ["F" * 8 + "T" * 8] + ["T" * 16] * 15
    state, _ = drawn(rows, [[15, 15]])
    assets = torch.tensor([[1.0, 2.0], [3.0, 6.0]]).repeat_interleave(8, 0).repeat_interleave(8, 1)
    both = concatenated([state, state])
    weighed = both.landscape.with_layers(assets=torch.stack((assets, 10.0 * assets)))
    both = both.replace(ground=both.ground.replace(landscape=weighed))
    assert Coverage().value(both, count_trees(both)).tolist() == pytest.approx([248 / 256 + 0.02 * 11 / 3] * 2)


def test_collaborative_multiplies_by_those_who_were_useful_lately():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # One of two puts the fire out: eta 1 + 0.5 / 2 = 1.25 on Q = (15 + 0.9) / 16; before, 1 on 15 / 16.
    wanted = 1.25 * 15.9 / 16 - 15 / 16
    assert earned(Collaborative(), state, world, EXTINGUISH, STAY) == pytest.approx([wanted] * 2)


def test_a_useful_act_counts_for_sixteen_steps():
    state, _ = drawn(FIELD, [[0, 0], [3, 3]])
    useful = state.vehicles.replace(last_useful=torch.tensor([[4, -1]], dtype=torch.int32))
    for step, eta in ((5, 1.25), (20, 1.25), (21, 1.0)):
        now = state.replace(vehicles=useful, step=torch.tensor([step], dtype=torch.int32))
        assert Collaborative().value(now, count_trees(now)).item() == pytest.approx(eta * 15 / 16)


def test_collaborative_does_not_soften_a_loss_unless_printed():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # w_p = -1 makes Q negative: -15 / 16, then (-15 + 0.9) / 16.
    loss = Collaborative(preserved=-1.0)
    assert earned(loss, state, world, EXTINGUISH, STAY) == pytest.approx([0.9 / 16] * 2)
    printed = Collaborative(preserved=-1.0, rule="printed")
    assert earned(printed, state, world, EXTINGUISH, STAY) == pytest.approx([-1.25 * 14.1 / 16 + 15 / 16] * 2)


def test_adaptive_by_hand():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # Put out: Q + 0.9 / 16; r_1 one tree at the fire's centre, 1 / 16; r_2 all 15 trees lay within three cells of fire,
    # now none; r_3 no ray met a barrier, now nothing burns, 1.
    wanted = 0.9 / 16 + 0.1 * (1 / 16 + 15 / 16 + 1.0)
    assert earned(Adaptive(), state, world, EXTINGUISH, STAY) == pytest.approx([wanted] * 2)


def test_adaptive_charges_the_fuel_within_three_cells_of_fire():
    # Of 81 trees the one in the middle burns; within three cells of it stand 7 x 7 - 1 = 48.
    state, _ = drawn(["T" * 9] * 4 + ["TTTTFTTTT"] + ["T" * 9] * 4, [[0, 0]])
    assert Adaptive(contained=0.0).value(state, count_trees(state)).item() == pytest.approx(80 / 81 - 0.1 * 48 / 81)


def test_adaptive_pays_for_the_downwind_half_and_once():
    # Two fires in a row, their centre between them; the wind blows east, so the eastern one is downwind.
    state, world = drawn(["TTTTTTT", "TFTTTFT", "TTTTTTT"] + ["TTTTTTT"] * 4, [[0, 0], [0, 6]])
    state = in_wind(state, world.fire, torch.tensor([4.0, 0.0])[None, :, None, None])
    head = Adaptive(exposed=0.0, contained=0.0)
    west = earned(head, state, world, EXTINGUISH, STAY)[0]
    east = earned(head, state, world, STAY, EXTINGUISH)[0]
    assert west == pytest.approx(0.9 / 49)
    assert east == pytest.approx(0.9 / 49 + 0.1 / 49)
    again = state.replace(extinguished=state.cells == 11)
    assert earned(head, again, world, STAY, EXTINGUISH)[0] == pytest.approx(0.9 / 49)


@pytest.mark.parametrize("reward", CONSERVATION)
def test_each_telescopes_to_its_closed_form(make_small_env, reward):
    """The return of random play is R(end) - R(start), less the acts; r_1 of ``adaptive`` is an event, and left out."""
    options = {"downwind": 0.0} if reward is Adaptive else {"horizon": 36} if reward is Time else {}
    component = reward(**options)
    env = make_small_env(8, small_world(horizon=36, landscape=Perlin(size=12, relief=40.0)), reward=component)
    torch.manual_seed(0)
    now = env.reset()
    start, total = component.value(env.world_state, env.tree_counts), torch.zeros(8)
    for _ in range(36):
        now = env.step(env.rand_action(now))["next"]
        total += now["agents", "reward"].mean(1)[:, 0]
    assert now["done"].all()
    state, counts = env.world_state, count_trees(env.world_state)
    wanted = component.value(state, counts) - start - component.act * state.vehicles.acts.sum(1) / counts.initial
    torch.testing.assert_close(total, wanted, atol=1e-5, rtol=0)
    assert wanted.abs().min() > 1e-3


def test_q_is_that_of_the_metrics(make_small_env):
    env = make_small_env(6, small_world(horizon=60))
    torch.manual_seed(0)
    now = env.reset()
    for _ in range(60):
        now = env.step(env.rand_action(now))["next"]
    info = now["info"]
    wanted = info["saved"] - 0.1 * info["extinguished"] - 0.5 * info["cleared"] - info["burned"]
    torch.testing.assert_close(Efficiency().worth(env.tree_counts), wanted[:, 0], atol=1e-6, rtol=0)


@pytest.mark.parametrize("barrier", ["lake", "firebreak", "wet"])
def test_adaptive_counts_every_kind_of_barrier_as_containment(barrier):
    # Fire in the middle of 5 x 5, and a ring of one kind about it: every ray meets it.
    state, _ = drawn(["TTTTT", "TTTTT", "TTFTT", "TTTTT", "TTTTT"], [[0, 0], [4, 4]])
    ring = torch.ones(1, 5, 5, dtype=torch.bool)
    ring[:, 2, 2] = False
    counts = count_trees(state)
    open_ground = Adaptive(exposed=0.0).value(state, counts)
    if barrier == "lake":
        state = state.replace(ground=state.ground.replace(alpha=torch.where(ring, 0.0, state.alpha)))
    else:
        state = state.replace(**{barrier: ring.to(getattr(state, barrier).dtype)})
    assert (Adaptive(exposed=0.0).value(state, counts) - open_ground).item() == pytest.approx(0.1)
