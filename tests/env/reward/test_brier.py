"""The reward for a belief that fits the fire."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.reward.brier import Brier
from warp_torchrl.runs.config.construction import ConfigError

BELIEVES = ["reward=brier", "belief=ensemble", "belief.members=2", "belief.hidden=0", "landscape.size=16"]
pytestmark = needs("belief", "radio", "sensing")


@needs("flight")
def test_all_are_paid_for_the_skill_of_the_belief_and_each_for_its_own_near_misses():
    env = make_env("spread_front", n_worlds=3, overrides=[*BELIEVES, "steps_per_tick=2", "reward.near_miss=0.5"])
    now = env.reset()
    for _ in range(4):
        before = env.world_state.plane("flight", "near_misses")
        now = env.step(env.rand_action(now))["next"]
        skill, misses = env.world_state.plane("belief", "skill"), env.world_state.plane("flight", "near_misses")
        own = 0.02 * skill[:, None] - 3 * 0.5 * (misses - before)
        torch.testing.assert_close(now["agents", "reward"][..., 0], 5.0 * own.mean(dim=1, keepdim=True).expand(-1, 3))
    assert (skill > 0.0).any() and (misses > 0).any()
    with_own = make_env("front", n_worlds=1, overrides=[*BELIEVES, "reward.team_share=0"]).reward_function
    assert with_own.team_share == 0.0 and with_own.shaping == 0.0


def test_it_needs_beliefs():
    said = "^belief must be ensemble where reward is brier"
    with pytest.raises(ConfigError, match=said):
        make_env("search", n_worlds=1, overrides=["reward=brier"])
    with pytest.raises(ValueError, match=said):
        WildfireEnv(small_world(), reward=Brier())


@pytest.mark.parametrize("name", ["skill", "near_miss"])
def test_a_negative_weight_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} must be in"):
        Brier(**{name: -1.0})
