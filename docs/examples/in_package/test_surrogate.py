"""The surrogate's gradient by hand."""

import torch

from warp_torchrl.algorithms.held_batch import ADVANTAGE, with_advantages
from warp_torchrl.algorithms.surrogate import Surrogate
from warp_torchrl.models import ACTION, LOG_PROB, Mlp, over_canonical, signature


def test_the_objective_is_the_ratio_times_the_advantage(make_small_env):
    env, model = make_small_env(4), Mlp(actor_hidden=(16,), critic_hidden=(16,))
    learner = Surrogate().build(env, model, 32)
    with torch.no_grad():
        batch = env.rollout(8, learner.explore, break_when_any_done=False)
        data = with_advantages(learner.loss, batch, model.canonical_batch(signature(env)))
    data[LOG_PROB] -= 1.0  # as if each action had been e times less likely when it was chosen
    log_prob = over_canonical(learner.policy).get_dist(data).log_prob(data[ACTION])
    ratio = (log_prob - data[LOG_PROB]).exp()
    assert (ratio > 2.7).all(), "PPO would have clipped each of them to 1.2"
    torch.testing.assert_close(learner.loss(data)["loss_objective"], -(ratio * data[ADVANTAGE][..., 0]).mean())
