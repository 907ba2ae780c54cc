"""The reward for worth that is left and fires that stay small, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.reward.worth import Worth
from warp_torchrl.runs.config.construction import ConfigError

pytestmark = needs("values")
PAID = ["landscape.size=12", "horizon=40", "steps_per_tick=1", "reward=worth", "reward.scale=1"]


@pytest.mark.parametrize(("saved", "size"), [(1.0, 0.0), (0.0, 1.0), (2.0, 0.5)])
def test_an_episode_earns_the_worth_lost_and_the_size_of_its_fire_up_to_that_at_which_it_escapes(saved, size):
    # Cells of 30 m are 0.09 ha: some 14 burn at the start, 1.3 ha, and a fire has escaped over 3 ha.
    keys = [f"reward.saved={saved}", f"reward.size={size}", "reward.shaping=0", "mechanics.values.escape_area=3.0"]
    env = make_env("skirmish", n_worlds=4, overrides=[*PAID, *keys])
    now = env.reset()
    start, earned = now["info", "fire_size"], torch.zeros(4, 2)
    assert ((start > 1.0) & (start < 2.0)).all()
    for _ in range(40):
        now = env.step(env.full_action_spec.zero())["next"]  # north: nobody fights
        earned += now["agents", "reward"][..., 0]
    lost, grown = 1.0 - now["info", "worth_saved"], now["info", "fire_size"].clamp(max=3.0) / 3.0 - start / 3.0
    torch.testing.assert_close(earned, (-saved * lost - size * grown).expand(-1, 2), rtol=1e-5, atol=1e-5)
    assert (lost > 0.2).any() and (now["info", "escaped"] == 1.0).any()


def test_it_needs_values():
    said = "^mechanics.values must be there where reward is worth"
    with pytest.raises(ConfigError, match=said):
        make_env("skirmish", n_worlds=1, overrides=["reward=worth"])
    with pytest.raises(ValueError, match=said):
        WildfireEnv(small_world(), reward=Worth())


@pytest.mark.parametrize("name", ["saved", "size"])
def test_a_negative_weight_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} must be in"):
        Worth(**{name: -1.0})
