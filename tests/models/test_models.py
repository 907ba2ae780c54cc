"""Networks fit their signature, and an actor sees its own observation and nothing else."""

import pytest
import torch
from torch import nn

from tests.conftest import small_world
from warp_torchrl.algorithms.held_batch import with_advantages
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env.observation import Local, Paper, Surroundings
from warp_torchrl.models import (
    ACTION,
    ACTION_ONE_HOT,
    LOGITS,
    OBSERVATION,
    STATE_ACTION_VALUE,
    VALUE,
    Entry,
    Mlp,
    signature,
)
from warp_torchrl.models.networks import LinearEncoder
from warp_torchrl.world.team.team import Team


def test_the_encoder_equals_one_layer_over_joined_fractions():
    entries = [Entry((2, 3), "uint8"), Entry((4,), "float32")]
    encoder = LinearEncoder(entries, 5)
    pixels, numbers = torch.randint(0, 256, (7, 2, 3), dtype=torch.uint8), torch.randn(7, 4)
    weight = torch.cat([part.weight for part in encoder.parts], dim=1)
    joined = torch.cat((pixels.flatten(1) / 255.0, numbers), dim=1)
    assert torch.allclose(encoder(pixels, numbers), nn.functional.linear(joined, weight), atol=1e-5)


@pytest.mark.parametrize("observation", [Surroundings(), Local(), Paper()], ids=lambda each: type(each).__name__)
@pytest.mark.parametrize("central", [True, False])
def test_actor_and_critic_fit_every_preset(make_small_env, observation, central):
    env = make_small_env(3, observation=observation)
    shape, now = signature(env), env.reset()
    assert Mlp().actor(shape)(now)[LOGITS].shape == (3, 2, 11)
    assert Mlp().critic(shape, central)(now)[VALUE].shape == (3, 2, 1)


@pytest.mark.parametrize("sharing", ["team", "role", "none"])
def test_a_central_critic_sees_the_state_and_what_each_agent_sees(make_small_env, sharing):
    env = make_small_env(3)
    now = env.reset()
    for central in (True, False):
        critic = Mlp(sharing=sharing).critic(signature(env), central)
        before = critic(now.clone())[VALUE]
        other = now.clone()
        other["state"] = other["state"] + 1.0
        assert (critic(other)[VALUE] != before).all() if central else (critic(other)[VALUE] == before).all()
        other = now.clone()
        other[(*OBSERVATION, "status")][:, 1] += 1.0
        assert (critic(other)[VALUE][:, 0] == before[:, 0]).all() and (critic(other)[VALUE][:, 1] != before[:, 1]).all()


@pytest.mark.parametrize("sharing", ["team", "role", "none"])
@pytest.mark.parametrize(("observation", "reads"), [(Surroundings(), False), (Local(), True)], ids=["picture", "none"])
def test_a_central_critic_does_without_views_where_there_is_a_picture(make_small_env, sharing, observation, reads):
    env = make_small_env(3, observation=observation)
    now = env.reset()
    other = now.clone()
    other[(*OBSERVATION, "view")] = 255 - other[(*OBSERVATION, "view")]
    model = Mlp(sharing=sharing, symmetry="none")
    shape = signature(env)
    central = model.critic(shape, central=True)
    assert torch.equal(central(now.clone())[VALUE], central(other.clone())[VALUE]) is not reads
    now[ACTION_ONE_HOT] = other[ACTION_ONE_HOT] = torch.zeros(3, 2, 11)
    own, judge = model.critic(shape, central=False), model.action_critic(shape, central=True)
    for critic, key in ((own, VALUE), (judge, STATE_ACTION_VALUE)):
        assert (critic(now.clone())[key] != critic(other.clone())[key]).all()


def test_an_actor_sees_only_its_own_observation(make_small_env):
    env = make_small_env(3)
    actor, now = Mlp().actor(signature(env)), env.reset()
    before = actor(now.clone())[LOGITS]
    for name in ("view", "status", "picture"):
        now[(*OBSERVATION, name)][:, 1] = torch.ones_like(now[(*OBSERVATION, name)][:, 1])
    now["state"] = torch.randn_like(now["state"])
    after = actor(now)[LOGITS]
    assert (after[:, 0] == before[:, 0]).all() and (after[:, 1] != before[:, 1]).any()


def test_half_precision_is_near_and_keeps_float32_weights(make_small_env):
    env = make_small_env(3)
    now = env.reset()
    torch.manual_seed(1)
    exact = Mlp(dtype="float32").actor(signature(env))
    torch.manual_seed(1)
    half = Mlp(dtype="bfloat16").actor(signature(env))
    assert all(parameter.dtype == torch.float32 for parameter in half.parameters())
    logits = half(now)[LOGITS]
    assert logits.dtype == torch.float32 and torch.allclose(logits, exact(now)[LOGITS], atol=2e-3)


def test_masked_actions_are_never_chosen(make_small_env):
    env = make_small_env(64)
    policy, now = Ppo().policy(signature(env), Mlp()), env.reset()
    mask = torch.zeros_like(now["agents", "action_mask"])
    mask[..., 4] = True  # all but one masked
    now["agents", "action_mask"] = mask
    out = policy(now)
    assert (out[ACTION] == 4).all() and torch.isfinite(out["agents", "action_log_prob"]).all()


@pytest.mark.parametrize(("field", "value"), [("actor_hidden", ()), ("critic_hidden", (0,))])
def test_sizes_out_of_range_are_refused(field, value):
    with pytest.raises(ValueError, match=f"{field} must be"):
        Mlp(**{field: value})


# Who shares a network.


def mixed_env(make_small_env, **options):
    return make_small_env(3, small_world(team=Team(n_agents=4, roles=("ugv", "uav"))), **options)


@pytest.mark.parametrize("sharing", ["team", "role", "none"])
@pytest.mark.parametrize("observation", [Surroundings(), Paper()], ids=lambda each: type(each).__name__)
def test_every_way_of_sharing_fits_and_learns(make_small_env, sharing, observation):
    env = mixed_env(make_small_env, observation=observation)
    model = Mlp(sharing=sharing, actor_hidden=(16,), critic_hidden=(16,))
    for central in (True, False):
        learner = Ppo(central_critic=central, minibatch_size=12).build(env, model, 12)
        with torch.no_grad():
            batch = env.rollout(4, learner.explore, break_when_any_done=False)
        terms = learner.loss(with_advantages(learner.loss, batch, model.canonical_batch(signature(env), state=central)))
        sum(terms[key] for key in learner.loss_keys).backward()
        gradients = [p.grad for p in learner.loss.parameters() if p.requires_grad]
        assert all(g is not None and g.isfinite().all() for g in gradients)


def test_networks_are_chosen_by_the_role_whatever_the_team(make_small_env):
    env = mixed_env(make_small_env)
    actor, now = Mlp(sharing="role", symmetry="none").actor(signature(env)), env.reset()
    assert now["agents", "role"].tolist() == [[0, 1, 0, 1]] * 3
    own = [network(*(now[key] for key in signature(env).observation_keys())) for network in actor.module.networks]
    logits = actor(now)[LOGITS]
    for agent in range(4):
        assert torch.equal(logits[:, agent], own[agent % 2][:, agent])
    other = make_small_env(2, small_world(team=Team(n_agents=3, roles=("uav",))))
    assert actor(other.reset())[LOGITS].shape == (2, 3, 11)


def test_agents_without_sharing_have_a_network_each(make_small_env):
    env = mixed_env(make_small_env)
    actor, now = Mlp(sharing="none", symmetry="none").actor(signature(env)), env.reset()
    before = actor(now.clone())[LOGITS]
    nn.init.zeros_(actor.module.networks[2].body[-1].weight)
    after = actor(now)[LOGITS]
    changed = [(after[:, agent] != before[:, agent]).any().item() for agent in range(4)]
    assert changed == [False, False, True, False]


@pytest.mark.parametrize("native", [True, False])
def test_auto_computes_in_half_precision_only_where_the_processor_does(make_small_env, monkeypatch, native):
    env = make_small_env(3)
    torch.manual_seed(0)
    auto = Mlp(dtype="auto").actor(signature(env))
    torch.manual_seed(0)
    fixed = Mlp(dtype="bfloat16" if native else "float32").actor(signature(env))
    monkeypatch.setattr("warp_torchrl.models.networks.computes_in_half", lambda device: native)
    now = env.reset()
    assert torch.equal(auto(now.clone())[LOGITS], fixed(now.clone())[LOGITS])
