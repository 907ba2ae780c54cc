"""A2C's terms by hand, and its one update for each batch."""

import pytest
import torch

from warp_torchrl.algorithms.a2c import A2c
from warp_torchrl.algorithms.held_batch import ADVANTAGE, VALUE_TARGET, with_advantages
from warp_torchrl.models import ACTION, VALUE, Mlp, over_canonical, signature

SMALL = Mlp(actor_hidden=(16,), critic_hidden=(16,))


@pytest.mark.parametrize("central", [True, False])
def test_the_terms_are_those_of_the_textbook(make_small_env, central):
    env = make_small_env(4)
    torch.manual_seed(0)
    learner = A2c(central_critic=central, entropy_coeff=0.02, critic_coeff=0.5).build(env, SMALL, 32)
    with torch.no_grad():
        batch = env.rollout(8, learner.explore, break_when_any_done=False)
    data = with_advantages(learner.loss, batch, SMALL.canonical_batch(signature(env), state=central))
    assert data.batch_size == (32,) and data[ADVANTAGE].shape == data[VALUE_TARGET].shape == (32, 2, 1)
    terms = learner.loss(data)
    distribution = over_canonical(learner.policy).get_dist(data)
    log_prob, entropy = distribution.log_prob(data[ACTION]), distribution.entropy()
    with learner.loss.critic_network_params.to_module(learner.loss.critic_network):
        value = learner.loss.critic_network(data.clone())[VALUE]
    torch.testing.assert_close(terms["loss_objective"], -(log_prob * data[ADVANTAGE][..., 0]).mean())
    torch.testing.assert_close(terms["loss_entropy"], -0.02 * entropy.mean())
    torch.testing.assert_close(terms["loss_critic"], 0.5 * (value - data[VALUE_TARGET]).square().mean())
    target = data[VALUE_TARGET]
    explained = 1.0 - (target - value).var(0, correction=0) / target.var(0, correction=0)
    torch.testing.assert_close(terms["explained_variance"], explained, rtol=1e-3, atol=1e-4)


def test_the_advantages_of_each_agent_are_standardised_where_asked(make_small_env):
    env = make_small_env(4)
    torch.manual_seed(0)
    with torch.no_grad():
        batch = env.rollout(8, A2c().policy(signature(env), SMALL), break_when_any_done=False)
    found = {}
    for asked in (False, True):
        torch.manual_seed(1)
        loss = A2c(normalize_advantage=asked).build(env, SMALL, 32).loss
        found[asked] = with_advantages(loss, batch.clone(), SMALL.canonical_batch(signature(env)))[ADVANTAGE]
    plain = found[False]
    torch.testing.assert_close(found[True], (plain - plain.mean(0)) / plain.std(0), rtol=1e-3, atol=1e-4)
    assert (plain.std(0) < 0.9).all()


def test_an_entropy_bonus_of_nought_may_still_rise(make_small_env):
    env = make_small_env(4)
    learner = A2c(entropy_coeff=0.0, entropy_coeff_end=0.02).build(env, SMALL, 32)
    with torch.no_grad():
        learner.store(env.rollout(8, learner.explore, break_when_any_done=False))
    (sample,) = learner.samples()
    assert learner.loss(sample)["loss_entropy"] == 0.0
    learner.schedule(1.0)
    assert learner.loss(sample)["loss_entropy"] < 0.0


def test_a_batch_is_seen_once(make_small_env):
    env = make_small_env(4)
    learner = A2c().build(env, SMALL, 32)
    with torch.no_grad():
        learner.store(env.rollout(8, learner.explore, break_when_any_done=False))
    samples = list(learner.samples())
    assert [len(sample) for sample in samples] == [32]


@pytest.mark.parametrize("field, value", [("gamma", 1.5), ("learning_rate", -1.0), ("max_grad_norm", 0.0)])
def test_values_out_of_range_are_refused(field, value):
    with pytest.raises(ValueError, match=f"{field} must be in"):
        A2c(**{field: value})
