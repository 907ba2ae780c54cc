"""Discrete SAC's three losses by hand."""

import torch
from torch.nn.functional import smooth_l1_loss

from tests.algorithms.test_dqn import three_transitions
from warp_torchrl.algorithms.sac import Sac
from warp_torchrl.models import ACTION, ACTION_MASK, ACTION_VALUE, LOGITS, Mlp, over_canonical

SMALL = Mlp(actor_hidden=(8,), critic_hidden=(8,))


def test_the_losses_by_hand(make_small_env):
    """V(s) = sum_a pi(a|s) (min_i Q_i(s, a) - alpha log pi(a|s)), over the open actions."""
    env = make_small_env(1)
    algorithm = Sac(gamma=0.9, temperature=0.3, target_entropy=0.5, warm_up=1, capacity=3, minibatch_size=3)
    learner = algorithm.build(env, SMALL, 3)
    loss = learner.loss
    loss.target_qvalue_network_params.apply_(lambda weight: weight.data.mul_(0.5))
    data = three_transitions(env, learner)

    def policy(entries):
        actor = over_canonical(learner.policy[0], restored=True)
        logits = actor(entries.select(*actor.in_keys).clone())[LOGITS]
        log_prob = logits.masked_fill(~entries[ACTION_MASK], -1e4).log_softmax(-1)
        return log_prob.exp(), log_prob

    def each_value(params, entries):
        found = []
        for index in range(2):
            with params[index].to_module(loss.qvalue_network):
                found.append(loss.qvalue_network(entries.select(*loss.qvalue_network.in_keys).clone())[ACTION_VALUE])
        return torch.stack(found)

    with torch.no_grad():
        prob, log_prob = policy(data["next"])
        soft = each_value(loss.target_qvalue_network_params, data["next"]).amin(0) - 0.3 * log_prob.clamp(min=-18.0)
        reward = torch.tensor([[0.5, 1.0], [-1.0, 0.0], [2.0, 3.0]])
        wanted = reward + 0.9 * torch.tensor([[1.0], [1.0], [0.0]]) * (prob * soft).sum(-1)
        now = each_value(loss.qvalue_network_params, data)
        said = now.gather(-1, data[ACTION][None, ..., None].expand(2, -1, -1, -1))[..., 0]
        prob, log_prob = policy(data)
        entropy = -(prob * log_prob).sum(-1)
    assert not torch.equal(now[0], now[1]), "the two critics start apart"
    terms = loss(data)
    close = {"atol": 1e-5, "rtol": 1e-4}
    torch.testing.assert_close(
        terms["loss_qvalue"].detach(), smooth_l1_loss(said[0], wanted) + smooth_l1_loss(said[1], wanted), **close
    )
    torch.testing.assert_close(
        terms["loss_actor"].detach(), (prob * (0.3 * log_prob - now.amin(0))).sum(-1).mean(), **close
    )
    target = 0.5 * torch.log(torch.tensor(11.0))
    log_alpha = torch.log(torch.tensor(0.3))
    torch.testing.assert_close(terms["loss_alpha"].detach(), (-log_alpha * (target - entropy)).mean(), **close)
    torch.testing.assert_close(terms["entropy"], entropy.mean(), **close)


def test_the_actor_s_loss_leaves_the_critics_alone(make_small_env):
    env = make_small_env(1)
    learner = Sac(warm_up=1, capacity=3, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    learner.loss(data)["loss_actor"].backward()
    assert all(weight.grad is None for weight in learner.loss.qvalue_network_params.values(True, True))
    assert all(weight.grad is not None for weight in learner.loss.actor_network_params.values(True, True))
