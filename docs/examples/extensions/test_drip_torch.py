"""Crews with drip torches, by hand and in play."""

from pathlib import Path

import pytest
import torch
from drip_torch import Burners

from tests.world.drawing import draw, drawn
from warp_torchrl import load_policy, make_env
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import Mlp, signature
from warp_torchrl.runs.policies.trained import TrainedPolicy

GOLDEN = Path(__file__).parents[3] / "tests" / "golden" / "0.1.0"
CLEAR, STAY, IGNITE = 9, 10, 11
TEAM = Burners(n_agents=2)


def act(state, *actions):
    return TEAM.act(state, torch.tensor([actions]), torch.tensor([True]), 14, 10)


def test_a_burner_ignites_its_own_tree_and_a_bulldozer_does_not() -> None:
    state = draw("7.3", team=TEAM, at=[(0, 0), (0, 2)])
    assert TEAM.action_names[IGNITE] == "ignite" and TEAM.agent_names == ["bulldozer_0", "burner_0"]
    mask = TEAM.action_mask(state, 14)[0, :, [CLEAR, STAY, IGNITE]]
    assert mask.tolist() == [[True, True, False], [False, True, True]]
    after, result = act(state, IGNITE, IGNITE)
    assert drawn(after) == "7.a" and after.age[0].tolist() == [[0, 0, 3]]
    assert result.credited.tolist() == [[False, True]] and after.vehicles.acts.tolist() == [[1, 1]]


def test_who_comes_first_at_a_tree_has_it() -> None:
    after, result = act(draw(".T.", team=TEAM, at=[(0, 1), (0, 1)]), CLEAR, IGNITE)
    assert drawn(after) == "..." and after.age.sum() == 0
    assert result.cleared.tolist() == [[True, False]] and result.redundant.tolist() == [[False, True]]


def test_a_policy_that_was_trained_before_plays_beside_burners() -> None:
    policy = load_policy(GOLDEN, mode="deterministic")
    env = make_env("skirmish", n_worlds=4, plugins=["drip_torch"], overrides=[*policy.overrides, "team=burners"])
    played = env.rollout(12, policy.fitted(env), break_when_any_done=False)["agents"]
    assert played["action_mask"].shape[-1] == 12 and played["action"].max() < IGNITE
    for heuristic in HEURISTICS.values():
        env.rollout(4, heuristic(env), break_when_any_done=False)


@pytest.mark.parametrize("sharing", ["team", "role"])
def test_a_policy_that_knows_the_torch_is_refused_where_there_is_none(sharing: str) -> None:
    env = make_env("default", n_worlds=16, plugins=["drip_torch"], overrides=["team=burners"])
    learnt = signature(env)
    assert learnt.actions[-1] == "ignite" and learnt.roles == ("ugv", "uav", "burner")
    assert {"role_burner", "last_ignite"} <= set(learnt.observation["status"].names)
    policy = TrainedPolicy(Ppo().policy(learnt, Mlp(sharing=sharing)), "sampled", learnt)
    now = env.rollout(9, policy, break_when_any_done=False)["agents"]
    last = now["observation", "status"][:, 1:, :, learnt.observation["status"].names.index("last_ignite")]
    assert torch.equal(last == 1.0, now["action"][:, :-1] == IGNITE) and last.any()
    with pytest.raises(ValueError, match="12 actions, this environment has 11: ignite"):
        policy.fitted(make_env("default", n_worlds=2))
