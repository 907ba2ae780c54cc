"""What every option of ``conf/algorithm`` must do: learn, keep to its masks, and act on what each agent sees."""

from dataclasses import replace

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.conftest import small_world
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, REWARD, Cnn, Mlp
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, conf_folder
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.team.team import Team

NAMES = sorted(path.stem for path in (conf_folder() / "algorithm").glob("*.yaml"))
REPLAYS = {"dqn", "vdn", "qmix", "sac", "ddpg", "maddpg"}
SMALL = Mlp(actor_hidden=(32,), critic_hidden=(32,))


def algorithm(name, *overrides):
    """The algorithm of a yaml, with a memory and minibatches that fit a test."""
    if name in REPLAYS:
        overrides = ("algorithm.capacity=512", "algorithm.warm_up=64", "algorithm.updates=8", *overrides)
    overrides = (f"algorithm={name}", "algorithm.minibatch_size=64", "n_worlds=16", "collector.steps=8", *overrides)
    return run_config(plain(compose_config("train", list(overrides)))).algorithm


def hasty(name):
    """The same with few updates a batch."""
    made = algorithm(name)
    few = "updates" if name in REPLAYS else "epochs"
    return replace(made, **{few: 2}) if hasattr(made, few) else made


def collected(env, learner, steps):
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        return env.rollout(steps, learner.explore, break_when_any_done=False).contiguous()


def learn(learner, batch):
    """Take the optimiser steps that follow a batch; return the last loss's terms."""
    learner.store(batch)
    terms = None
    for sample in learner.samples():
        terms = learner.loss(sample)
        sum(terms[key] for key in learner.loss_keys).backward()
        learner.optimizer.step()
        learner.optimizer.zero_grad()
        learner.after_step(sample)
    return terms


def test_the_contract_s_algorithms_are_there():
    assert set(NAMES) >= {"mappo", "ippo", "ppo", "a2c", *REPLAYS}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow)
        if name in ("mappo", "ppo", "ippo", "vdn", "qmix", "maddpg")
        else name
        for name in NAMES
    ],
)
def test_a_few_hundred_updates_raise_the_return_of_a_bandit(make_small_env, name):
    """Reward 1 for one action that is always open, the end after each step: what is paid must come to be done."""
    env = make_small_env(16, small_world(horizon=400))
    rate = "1e-3" if "ddpg" in name else "5e-3"  # gradients through a critic that has just begun are soon too strong
    options = [f"algorithm.learning_rate={rate}", "algorithm.learning_rate_end=1.0"]
    options += ["algorithm.tau=0.2"] if name in REPLAYS else []
    options += ["algorithm.temperature=0.01"] if name == "sac" else []
    learner = algorithm(name, *options).build(env, SMALL, 128)
    wanted = 10

    def share():
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            return (learner.policy(env.reset())[ACTION] == wanted).float().mean().item()

    before = share()
    first = collected(env, learner, 8)
    for iteration in range(45):
        learner.schedule(iteration / 45)
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            batch = learner.explore(first.clone())  # what is shown does not hang on what is done
        batch["next", *REWARD] = (batch[ACTION] == wanted).float()[..., None]
        batch["next", "terminated"] = batch["next", "done"] = torch.ones_like(batch["done"])
        learn(learner, batch)
        if iteration > 3 and share() == 1.0:
            break
    assert before < 0.7 and share() == 1.0


@pytest.mark.parametrize("name", NAMES)
def test_with_all_but_one_action_masked_that_one_is_done_and_the_loss_is_finite(make_small_env, name):
    env = make_small_env(16)
    learner = hasty(name).build(env, SMALL, 128)
    only = torch.zeros(16, 8, 2, 11, dtype=torch.bool)
    only[..., 4] = True
    batch = collected(env, learner, 8)
    batch[ACTION_MASK] = batch["next", *ACTION_MASK] = only
    batch[ACTION] = torch.full_like(batch[ACTION], 4)
    if ("agents", "action_one_hot") in batch.keys(True):
        batch["agents", "action_one_hot"] = only.float()
    terms = learn(learner, batch)
    assert all(value.isfinite().all() for value in terms.values())
    assert all(weight.isfinite().all() for weight in learner.loss.parameters())
    now = batch[:, 0].select(*learner.policy.in_keys)
    for kind in (ExplorationType.RANDOM, ExplorationType.DETERMINISTIC):
        with torch.no_grad(), set_exploration_type(kind):
            assert (learner.policy(now.clone())[ACTION] == 4).all()
            assert (learner.explore(now.clone())[ACTION] == 4).all()


@pytest.mark.parametrize("name", NAMES)
def test_masked_actions_are_never_chosen(make_small_env, name):
    env = make_small_env(32, small_world(team=Team(n_agents=3)))
    learner = algorithm(name).build(env, SMALL, 128)
    batch = collected(env, learner, 6)
    assert batch[ACTION_MASK].gather(-1, batch[ACTION][..., None]).all()
    assert not batch[ACTION_MASK].all()


@pytest.mark.parametrize(
    "model", [SMALL, Cnn(actor_hidden=(16,), critic_hidden=(16,), channels=(4,))], ids=["mlp", "cnn"]
)
@pytest.mark.parametrize("name", NAMES)
def test_an_agent_acts_on_what_it_sees_and_on_nothing_else(make_small_env, name, model):
    """Everything outside an agent's observation changes: the state and all that its team-mates see and may do."""
    env = make_small_env(16, small_world(team=Team(n_agents=3)))
    policy = algorithm(name).build(env, model, 128).policy
    now = env.reset()
    assert "state" not in policy.in_keys
    other = now.clone()
    other["state"] = torch.rand_like(other["state"])
    for key in ("view", "status", "picture"):
        entry = other[(*OBSERVATION, key)]
        entry[:, 1:] = (255 - entry[:, 1:]) if entry.dtype == torch.uint8 else torch.rand_like(entry[:, 1:])
    other[ACTION_MASK][:, 1:, :8] ^= True
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        before, after = policy(now)[ACTION], policy(other)[ACTION]
    assert (before[:, 0] == after[:, 0]).all() and (before[:, 1:] != after[:, 1:]).any()


@pytest.mark.parametrize(
    ("name", "sharing"),
    [
        *((name, "role") for name in NAMES),
        *(
            (name, "none") if name in ("mappo", "qmix", "sac") else pytest.param(name, "none", marks=pytest.mark.slow)
            for name in NAMES
        ),
    ],
)
def test_every_algorithm_learns_with_and_without_sharing(make_small_env, name, sharing):
    env = make_small_env(16, small_world(team=Team(n_agents=2, roles=("ugv", "uav"))))
    model = Mlp(sharing=sharing, actor_hidden=(8,), critic_hidden=(8,))
    learner = hasty(name).build(env, model, 128)
    before = {key: value.clone() for key, value in learner.policy.state_dict().items()}
    learn(learner, collected(env, learner, 8))
    moved = {key for key, value in learner.policy.state_dict().items() if not torch.equal(value, before[key])}
    assert all(any(f"networks.{index}." in key for key in moved) for index in (0, 1))
