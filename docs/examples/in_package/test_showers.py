"""Showers, by hand and in play."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl import load_policy, make_env
from warp_torchrl.env.metrics import metric_rows
from warp_torchrl.evaluation.report import evaluation_table, report
from warp_torchrl.world.mechanics.showers import Showers, Sky
from warp_torchrl.world.state.cells import is_tree


def stepped(showers, worlds=4):
    world = small_world(mechanics=(showers,), steps_per_tick=1000)
    state = world.reset(torch.arange(worlds), torch.zeros(worlds, dtype=torch.int64))
    return state, world.step(state, torch.full((worlds, 2), 10)).after


def test_a_shower_wets_the_trees_of_a_square():
    before, after = stepped(Showers(chance=1.0, radius=64, wet=3))
    assert torch.equal(after.wet, 3 * is_tree(after.cells)) and (after.planes("showers", Sky).rain == 255).all()
    assert after.planes("showers", Sky).rained.tolist() == [1.0] * 4
    _, after = stepped(Showers(chance=1.0, radius=0))
    assert (after.planes("showers", Sky).rain > 0).flatten(1).sum(1).tolist() == [1] * 4
    assert not stepped(Showers(chance=0.0))[1].wet.any() and not before.planes("showers", Sky).rain.any()


def test_a_shower_is_the_world_s_own_in_any_batch():
    _, after = stepped(Showers(chance=0.5), worlds=8)
    rain = after.planes("showers", Sky).rain
    assert 0 < (rain > 0).flatten(1).any(1).sum() < 8
    assert torch.equal(stepped(Showers(chance=0.5), worlds=3)[1].planes("showers", Sky).rain, rain[:3])


def test_agents_see_the_rain_and_tables_tell_of_it():
    env = make_env("showers", n_worlds=16)
    shown = env.rollout(20, break_when_any_done=False)["next"]
    assert env.channel_names["view"][-1] == "rain"
    seen = shown["agents", "observation", "view"][..., -1, :, :]
    assert set(seen.unique().tolist()) == {0, 255}
    rained = shown["info", "rained"][:, -1, 0]
    assert (rained > 0).all()
    episodes = {name: shown["info", name][:, -1, 0].numpy() for name in shown["info"].keys()}
    shown = evaluation_table(report("showers", "mine", 0, episodes, {}), metric_rows(env.world))
    assert f"{100 * rained.mean():.1f} (" in shown.partition("rained %")[2]


def test_an_older_policy_plays_under_showers():
    policy = load_policy("default", mode="deterministic")
    env = make_env("showers", n_worlds=2, overrides=["mechanics.showers.radius=1", *policy.overrides])
    assert Showers(chance=0.2, radius=1) in env.world.mechanics
    env.rollout(4, policy.fitted(env))


def test_a_chance_above_one_is_refused():
    with pytest.raises(ValueError, match="chance must be in"):
        Showers(chance=1.1)
