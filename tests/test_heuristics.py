"""The yardsticks do what they say, and rank as they should."""

import pytest
import torch

from warp_torchrl import make_env
from warp_torchrl.evaluation import play
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.state import Action


@pytest.mark.parametrize("name", HEURISTICS)
def test_every_heuristic_acts_within_the_mask_or_does_nothing(make_small_env, name):
    env = make_small_env(5)
    policy = HEURISTICS[name](env)
    now = env.reset()
    for _ in range(15):
        now = policy(now)
        action = now["agents", "action"]
        assert action.dtype == torch.int64 and action.shape == (5, 2)
        assert now["agents", "action_mask"].gather(-1, action[..., None]).all()
        now = env.step(now)["next"]


@pytest.mark.parametrize("name", HEURISTICS)
def test_heuristics_repeat_themselves(make_small_env, name):
    first, second = (play(env, HEURISTICS[name](env), 11) for env in (make_small_env(4), make_small_env(4)))
    assert (first["saved"] == second["saved"]).all()


def test_no_op_without_stay_changes_nothing(make_small_env):
    from tests.conftest import small_world
    from warp_torchrl.world.team import Team

    env = make_small_env(6, small_world(team=Team(n_agents=2, allow_stay=False)))
    episodes = play(env, HEURISTICS["noop"](env), 0)
    assert (episodes["extinguished"] == 0).all() and (episodes["cleared"] == 0).all()


def test_fighters_put_out_a_fire_beside_them(make_small_env):
    env = make_small_env(1)
    now = env.reset()
    state = env.world_state
    fire = (state.cells[0] == 11).nonzero() if (state.cells[0] == 11).any() else (state.cells[0] > 10).nonzero()
    place = fire[0].expand(1, 2, 2).clone()
    now = env.set_state(state.replace(vehicles=state.vehicles.replace(position=place)))
    for name in ("local", "greedy", "coordinated"):
        assert HEURISTICS[name](env)(now)["agents", "action"].tolist() == [[Action.EXTINGUISH] * 2]


def test_coordinated_agents_claim_different_fires():
    env = make_env("default", n_worlds=8)
    env.reset()
    policy = HEURISTICS["coordinated"](env)
    state = env.world_state
    threat = env.world.threat(state)
    value = (6.0 * threat).masked_fill(~(state.cells > 10), -30_000.0)
    claims = policy._claims(state, value)
    index = claims[..., 0] * 32 + claims[..., 1]
    for world in range(8):
        assert len(set(index[world].tolist())) == 4
        assert (state.cells[world].flatten()[index[world]] > 10).all()


def test_yardsticks_rank_on_skirmish():
    """64 fires: intervals of the means are about 4 points wide, the gaps 10 and more."""
    env = make_env("skirmish", n_worlds=64)
    saved = {name: play(env, HEURISTICS[name](env), 1_000_000)["saved"].mean() for name in HEURISTICS}
    assert saved["noop"] < 0.25
    assert saved["random"] < saved["local"] - 0.2
    assert saved["coordinated"] > saved["local"] + 0.1 and saved["coordinated"] > saved["greedy"] + 0.1
