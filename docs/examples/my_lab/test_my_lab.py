"""What the lab adds, in play: ``pytest`` in this folder."""

import my_lab
import torch

from warp_torchrl import make_env


def test_the_scenario_has_what_the_lab_adds():
    env = make_env("gap", n_worlds=4, plugins=[my_lab])
    assert env.world.wind == my_lab.ColdFront()
    assert env.channel_names["view"][-1] == "sapling"
    played = env.rollout(8, my_lab.Sentry(env), break_when_any_done=False)
    assert played["next", "agents", "reward"].shape == (4, 8, 3, 1)


def test_the_cost_of_fire_is_a_share_of_the_forest():
    env = make_env("gap", n_worlds=1, plugins=[my_lab], overrides=["reward.shaping=0", "reward.cost=1"])
    earned = env.rollout(1, my_lab.Sentry(env))["next", "agents", "reward"].squeeze()
    burns = (env.world_state.cells > 10).sum() / (env.world_state.cells > 0).sum()
    assert torch.allclose(earned, -burns.expand(3), rtol=0.1) and burns > 0
