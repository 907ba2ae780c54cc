"""Actors that remember: what one step leaves to the next, and what it must not."""

from functools import partial

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.conftest import small_world
from warp_torchrl.algorithms.a2c import A2c
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env.observation import Paper
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    LOGITS,
    MEMORY,
    OBSERVATION,
    REWARD,
    Cnn,
    Mlp,
    Recollection,
    memory_apart,
    over_canonical,
    recurrent_actors,
    signature,
)
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.team.team import Team

SMALL = {"actor_hidden": (16,), "critic_hidden": (16,), "memory": 8}
MODELS = {
    "canonical": Mlp(**SMALL),
    "none of symmetry": Mlp(**SMALL, symmetry="none"),
    "role": Mlp(**SMALL, sharing="role"),
    "none": Mlp(**SMALL, sharing="none"),
    "cnn": Cnn(**SMALL, channels=(4,)),
}
OWN = (*OBSERVATION, "status")


def lively(module):
    """Give the last layers weights that tell, which begin near nought."""
    with torch.no_grad():
        for weight in module.parameters():
            weight += 0.3 * torch.randn_like(weight)
    return module


@pytest.fixture
def make_env(make_small_env):
    def make(n_worlds=6, **changes):
        team = Team(n_agents=3, roles=("ugv", "uav", "ugv"))
        return make_small_env(n_worlds, small_world(team=team, horizon=9, **changes))

    return make


STEPS = 14
"""More than the nine of an episode."""


def played(env, policy, steps=STEPS):
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        return env.rollout(steps, policy, break_when_any_done=False).contiguous()


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_a_sequence_says_what_its_steps_said(make_env, model):
    """... over the ends of episodes, from the memory that it was recorded with, and in canonical orientation too."""
    env = make_env()
    policy = lively(Ppo().policy(signature(env), model))
    played(env, policy, steps=5)  # so that the sequence begins with a memory
    with torch.no_grad():
        now, steps = env.reset().clone(), []
        for _ in range(STEPS):
            acted = env.step(policy(now))
            steps.append(acted.clone())
            now = env.step_mdp(acted)
            now = env.maybe_reset(now)
    batch = torch.stack(steps, dim=1)[:, 4:]
    assert batch["next", "done"].any() and batch[MEMORY][:, 0].any()
    again = policy.module[0](batch.exclude(LOGITS))
    torch.testing.assert_close(again[LOGITS], batch[LOGITS])
    canonical = model.canonical_batch(signature(env))(batch.exclude(LOGITS))
    ours = over_canonical(policy).get_dist(canonical).log_prob(canonical[ACTION])
    torch.testing.assert_close(ours, policy.get_dist(batch).log_prob(batch[ACTION]))


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_what_was_seen_before_counts_until_an_episode_begins(make_env, model):
    env = make_env()
    policy = lively(Ppo().policy(signature(env), model))
    batch = played(env, policy)
    module = policy.module[0]
    before, other = module(batch.clone())[LOGITS], batch.clone()
    other[OWN][:, 2, 0, -9:-4] = 1.0 - other[OWN][:, 2, 0, -9:-4]  # what agent 0 did last, at step 2
    after = module(other)[LOGITS]
    changed = (before != after).any(-1)
    begins = batch[OWN][:, :, 0, 2] == 1.0
    for world in range(len(changed)):
        end = next(step for step in range(3, STEPS) if begins[world, step])
        assert not changed[world, :2].any()
        assert changed[world, 2 : min(end, 6), 0].all(), "later it may be too faint for the last digit"
        assert not changed[world, end:].any() and not changed[world, :, 1:].any()


def test_a_policy_forgets_where_an_episode_begins(make_env):
    env = make_env()
    policy = lively(Ppo().policy(signature(env), MODELS["canonical"]))
    now = env.reset()
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        first = policy(now.clone())[LOGITS].clone()
        assert torch.equal(policy(now.clone())[LOGITS], first), "its first step is its first step"
        later = env.step(policy(now.clone()))["next"]
        second = policy(later.clone())[LOGITS].clone()
        assert not torch.equal(policy(later.clone())[LOGITS], second), "the same sight twice is not the same past"


def test_a_world_s_memory_is_its_own(make_env):
    env = make_env()
    policy = lively(Ppo().policy(signature(env), MODELS["none"]))
    batch = played(env, policy)
    alone = lively(Ppo().policy(signature(env), MODELS["none"]))
    alone.load_state_dict(policy.state_dict())
    for step in range(STEPS):
        now = batch[2:3, step].exclude(LOGITS, MEMORY, ACTION)
        with torch.no_grad():
            torch.testing.assert_close(alone(now)[LOGITS], batch[2:3, step][LOGITS])


def test_whoever_acts_elsewhere_remembers_then_what_it_did_before(make_env):
    env, other = make_env(), make_env()
    policy = lively(Ppo().policy(signature(env), MODELS["canonical"]))
    played(env, policy, steps=3)
    kept = Recollection(policy).state_dict()
    assert kept["0"].any()
    play(other, policy, 50)
    assert torch.equal(Recollection(policy).state_dict()["0"], kept["0"])
    with memory_apart(policy):
        played(other, policy, steps=2)
        assert not torch.equal(Recollection(policy).state_dict()["0"], kept["0"])
    assert torch.equal(Recollection(policy).state_dict()["0"], kept["0"])


@pytest.mark.parametrize(
    "kind", [partial(Ppo, epochs=2), pytest.param(A2c, marks=pytest.mark.slow)], ids=["ppo", "a2c"]
)
@pytest.mark.parametrize("memory", [16, pytest.param(0, marks=pytest.mark.slow)])
def test_what_was_shown_at_first_is_learnt_to_matter_later_by_those_who_remember(make_small_env, kind, memory):
    """A cue in the first step, paid for in the third; without a memory half of the guesses are wrong.

    By chance 70 % of 320 guesses are right once in 10^12 times.
    """
    env = make_small_env(16, small_world(horizon=400))
    model = Mlp(actor_hidden=(32,), critic_hidden=(16,), memory=memory, symmetry="none")
    rates = {"learning_rate": 1e-2, "learning_rate_end": 1.0, "gamma": 0.5, "entropy_coeff": 0.0}
    learner = kind(minibatch_size=24, **rates).build(env, model, 48)
    shares = []
    for _ in range(30):
        cue = torch.randint(2, (16, 2))
        batch, right = asked(env, learner, cue)
        shares.append(right.float().mean().item())
        learner.store(batch)
        for sample in learner.samples():
            terms = learner.loss(sample)
            sum(terms[key] for key in learner.loss_keys).backward()
            learner.optimizer.step()
            learner.optimizer.zero_grad()
    share = sum(shares[-10:]) / 10
    assert share > 0.95 if memory else share < 0.7


def asked(env, learner, cue):
    """Return three steps, made up, of worlds whose first shows a cue and whose last asks for it, and who was right."""
    now, steps = env.reset(), []
    for step in range(3):
        seen = now.apply(torch.zeros_like)
        seen[OWN][..., 2] = 1.0 - 0.25 * step
        seen[OWN][..., 0] = cue * float(step == 0)
        seen[ACTION_MASK][..., 8:10] = True
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            acted = learner.explore(seen)
        right = acted[ACTION] == 8 + cue
        over = torch.full((16, 1), step == 2)
        acted["next"] = TensorDict({**seen.select("state", "agents").to_dict(), "done": over, "terminated": over}, [16])
        acted["next", *REWARD] = (right * float(step == 2))[..., None]
        steps.append(acted)
    return torch.stack(steps, dim=1).contiguous(), right


def test_a_minibatch_is_made_of_whole_sequences(make_env):
    env = make_env()
    learner = Ppo(minibatch_size=50, epochs=1).build(env, MODELS["canonical"], 6 * 24)
    learner.store(played(env, learner.explore, steps=24))
    assert [list(sample.shape) for sample in learner.samples()] == [[2, 24]] * 3
    learner = Ppo(minibatch_size=10, epochs=1).build(env, MODELS["canonical"], 6 * 24)
    learner.store(played(env, learner.explore, steps=24))
    assert [list(sample.shape) for sample in learner.samples()] == [[1, 24]] * 6


def test_numpy_agents_remember_by_name(make_env):
    """A team that is asked together, agent by agent by name, and on tensordicts does the same."""
    env = make_env(n_worlds=1)
    policy = lively(Ppo().policy(signature(env), MODELS["canonical"]))
    batch = played(env, policy)
    together, apart = (TrainedPolicy(policy, "deterministic", signature(env)).numpy_policy() for _ in range(2))
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        expected = [policy(batch[:, step].exclude(LOGITS, MEMORY, ACTION))[ACTION][0].tolist() for step in range(STEPS)]
    for step, wanted in enumerate(expected):
        seen = {
            name: {
                "action_mask": batch[ACTION_MASK][0, step, index].numpy(),
                **{key: batch[(*OBSERVATION, key)][0, step, index].numpy() for key in ("view", "status", "picture")},
            }
            for index, name in enumerate(env.agent_names)
        }
        assert list(together(seen).values()) == wanted
        assert [apart({name: each})[name] for name, each in seen.items()] == wanted
    assert len(recurrent_actors(policy)) == 1


def test_where_there_is_no_clock_there_is_no_memory(make_small_env):
    env = make_small_env(2, observation=Paper())
    with pytest.raises(ValueError, match=r"^model.memory must be 0 where observations have no clock, got 8$"):
        Ppo().policy(signature(env), MODELS["none of symmetry"])


@pytest.mark.parametrize("memory", [-8, 12, 8200])
def test_sizes_of_a_memory_that_are_refused(memory):
    with pytest.raises(ValueError, match=r"^memory must be "):
        Mlp(memory=memory)


def test_who_replays_does_not_remember():
    rule = "^model.memory must be 0 where the algorithm replays, got 8: choose mappo, ippo, ppo or a2c$"
    for name in ("dqn", "vdn", "qmix", "sac", "ddpg", "maddpg"):
        with pytest.raises(ConfigError, match=rule):
            run_config(plain(compose_config("train", [f"algorithm={name}", "model.memory=8"])))
