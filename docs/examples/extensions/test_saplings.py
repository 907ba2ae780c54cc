"""Saplings in view."""

from pathlib import Path

import torch

from warp_torchrl import load_policy, make_env

GOLDEN = Path(__file__).parents[3] / "tests" / "golden" / "0.1.0"


def test_saplings_are_the_trees_too_young_to_ignite():
    env = make_env("skirmish", n_worlds=8, plugins=["saplings"], overrides=["observation=saplings"])
    shown = env.reset()["agents", "observation", "view"][:, :, -1]
    row, column = env.world_state.vehicles.position.unbind(-1)
    codes = env.world_state.cells[torch.arange(8)[:, None], row, column]
    assert torch.equal(shown[:, :, 5, 5] == 255, codes == 1)
    assert env.channel_names["view"][-1] == "sapling" and shown.any()


def test_an_older_policy_plays_beside_them_as_it_did():
    policy = load_policy(GOLDEN, mode="deterministic")
    before = make_env("skirmish", n_worlds=4, overrides=policy.overrides)
    shown = ["observation=saplings", "observation.radius=1"]
    beside = make_env("skirmish", n_worlds=4, plugins=["saplings"], overrides=shown)
    played = [
        env.rollout(12, policy.fitted(env), break_when_any_done=False)["agents", "action"] for env in (before, beside)
    ]
    assert torch.equal(*played)
