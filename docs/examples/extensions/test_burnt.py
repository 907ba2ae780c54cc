"""What has burned, as agents and the critic see it."""

from pathlib import Path

import pytest
import torch

from warp_torchrl import load_policy, make_env
from warp_torchrl.models import Mlp, signature
from warp_torchrl.models.fitting import fitted

GOLDEN = Path(__file__).parents[3] / "tests" / "golden" / "0.1.0"


def test_what_has_burned_is_shown_to_agents_and_critic():
    env = make_env("skirmish", n_worlds=4, plugins=["burnt"], overrides=["observation=burnt"])
    env.reset()
    state = env.world_state
    burned = torch.zeros_like(state.burned)
    burned[:, :4, :8] = True  # 32 of 16 x 16 cells
    now = env.set_state(state.replace(burned=burned))
    seen = now["agents", "observation"]
    assert env.channel_names["status"][-1] == "burnt_share" and (seen["status"][..., -1] == 32 / 256).all()
    assert env.channel_names["picture"][-1] == "burnt_nearby"
    assert set(seen["picture"][:, :, -1].unique().tolist()) == {0, 255}
    assert env.state_names[-2:] == ("burnt", "clock_and_wind") and torch.equal(now["state"][:, -2], burned.float())


def test_burnt_ground_fits_older_policies_and_newer_ones_need_it():
    policy = load_policy(GOLDEN, mode="deterministic")
    plain, env = (
        make_env("skirmish", n_worlds=4, plugins=["burnt"], overrides=each)
        for each in (policy.overrides, ["observation=burnt", "observation.radius=1"])
    )
    before, beside = (policy.fitted(each)(each.reset())["agents", "action"] for each in (plain, env))
    assert torch.equal(before, beside)
    here, there = signature(make_env("skirmish", n_worlds=1, overrides=["observation=surroundings"])), signature(env)
    with pytest.raises(ValueError, match="trained to see burnt_"):
        fitted(Mlp().actor(there), there, here, fallback=8)
