"""Agents that trust their adviser."""

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type

from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.algorithms.sac import Sac
from warp_torchrl.api.make import make_env
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, LOGITS, Mlp, over_canonical, signature
from warp_torchrl.models.trust import Trust
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain

ADVISED = ("observation.advice=coordinated", "observation.rules=true")
SMALL = {"actor_hidden": (16,), "critic_hidden": (8,), "dtype": "float32"}


def test_the_advised_action_gains_by_the_size_of_the_team():
    names = ("rule_team", "advice_north", "advice_stay")
    told = torch.tensor([[[0.25, 0.0, 1.0], [0.25, 1.0, 0.0]], [[0.0, 0.0, 1.0], [0.125, 0.0, 1.0]]])
    logits = torch.tensor([[[1.0, 2.0]] * 2] * 2)
    shown = TensorDict({"agents": {"logits": logits, "status": told}}, batch_size=2)
    trust = Trust(("agents", "status"), names, ("stay", "north"), 0.5)
    # log2(A) is 8 x 0.25 = 2 in teams of four, 0 of a single vehicle, 1 in teams of two.
    assert trust(shown)[LOGITS].tolist() == [[[2.0, 2.0], [1.0, 3.0]], [[1.0, 2.0], [1.5, 2.0]]]


@pytest.mark.parametrize("symmetry", ["canonical", "none"])
def test_a_team_that_trusts_without_bounds_does_what_it_is_advised(symmetry):
    env = make_env("default", n_worlds=4, overrides=[*ADVISED, "landscape.size=16"])
    team = Ppo().policy(signature(env), Mlp(**SMALL, symmetry=symmetry, trust=100.0))
    adviser, now = HEURISTICS["coordinated"](env), env.reset()
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        for _ in range(10):
            assert torch.equal(team(now.clone())[ACTION], adviser(now.clone())[ACTION])
            now = env.step(env.rand_action(now))["next"]


def test_a_single_vehicle_trusts_itself():
    env = make_env("single", n_worlds=4, overrides=ADVISED)
    shape, now = signature(env), env.reset()
    trusting, doubting = (Mlp(**SMALL, trust=each).actor(shape) for each in (100.0, 0.0))
    trusting.load_state_dict(doubting.state_dict())
    assert torch.equal(trusting(now.clone())[LOGITS], doubting(now.clone())[LOGITS])


def test_it_learns_by_the_chances_by_which_it_acted():
    env = make_env("skirmish", n_worlds=8, overrides=ADVISED)
    learner = Ppo().build(env, Mlp(**SMALL, trust=2.0), 8 * 6)
    with torch.no_grad():
        batch = env.rollout(6, learner.policy, break_when_any_done=False)
    learner.store(batch.contiguous())
    sample = next(iter(learner.samples()))
    assert float(learner.loss(sample)["kl_approx"].abs()) < 1e-5
    actor = over_canonical(learner.policy[0])
    with_trust = actor(sample.clone())[LOGITS]
    assert not torch.allclose(with_trust, over_canonical(Mlp(**SMALL).actor(signature(env)))(sample.clone())[LOGITS])


@pytest.mark.parametrize("lacking", ["observation.advice=null", "observation.rules=false"])
def test_without_advice_and_rules_it_is_refused(lacking):
    env = make_env("skirmish", n_worlds=1, overrides=[*ADVISED, lacking])
    with pytest.raises(ValueError, match=r"^model.trust must be 0 where agents are not advised and told the rules"):
        Mlp(trust=0.5).actor(signature(env))


def test_values_of_actions_are_not_trusted():
    with pytest.raises(ValueError, match=r"^trust must be 0 where actions have values"):
        Dqn().check_model(Mlp(trust=0.5))
    Sac().check_model(Mlp(trust=0.5))


def test_a_run_is_refused_before_it_begins():
    for lacking in ((), ADVISED[:1], ADVISED[1:]):
        with pytest.raises(ConfigError, match=r"^model.trust must be 0 where agents are not advised"):
            run_config(plain(compose_config("train", ["model.trust=0.5", *lacking])))
    run_config(plain(compose_config("train", ["model.trust=0.5", *ADVISED])))
