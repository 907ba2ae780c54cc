"""DDPG's losses by hand, and the one-hot action that lets gradients through."""

import pytest
import torch
from torch.nn.functional import one_hot, smooth_l1_loss
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.algorithms.test_dqn import three_transitions
from warp_torchrl.algorithms.ddpg import Ddpg, OneHotChoice
from warp_torchrl.models import ACTION, ACTION_MASK, ACTION_ONE_HOT, LOGITS, STATE_ACTION_VALUE, Mlp, over_canonical

SMALL = Mlp(actor_hidden=(8,), critic_hidden=(8,))


@pytest.mark.parametrize("central", [False, True])
def test_the_losses_by_hand(make_small_env, central):
    env = make_small_env(1)
    algorithm = Ddpg(central_critic=central, gamma=0.9, warm_up=1, capacity=3, minibatch_size=3)
    learner = algorithm.build(env, SMALL, 3)
    loss = learner.loss
    data = three_transitions(env, learner)

    def choice(entries):
        actor = over_canonical(learner.policy.module[0], restored=True)
        logits = actor(entries.select(*actor.in_keys).clone())[LOGITS]
        return one_hot(logits.masked_fill(~entries[ACTION_MASK], -torch.inf).argmax(-1), 11).float()

    def value(entries, action):
        given = entries.clone(recurse=False)
        given[ACTION_ONE_HOT] = action
        with loss.value_network_params.to_module(loss.value_network):
            return loss.value_network(given.select(*loss.value_network.in_keys))[STATE_ACTION_VALUE][..., 0]

    with torch.no_grad():  # the target networks are still copies
        reward = torch.tensor([[0.5, 1.0], [-1.0, 0.0], [2.0, 3.0]])
        goes_on = torch.tensor([[1.0], [1.0], [0.0]])
        wanted = reward + 0.9 * goes_on * value(data["next"], choice(data["next"]))
        said = value(data, data[ACTION_ONE_HOT])
        best = value(data, choice(data))
    terms = loss(data)
    torch.testing.assert_close(terms["loss_value"].detach(), smooth_l1_loss(said, wanted))
    torch.testing.assert_close(terms["loss_actor"].detach(), -best.mean())
    terms["loss_actor"].backward()
    assert all(
        weight.grad.abs().sum() > 0 for weight in loss.actor_network_params.values(True, True) if weight.ndim > 1
    )
    assert all(weight.grad is None for weight in loss.value_network_params.values(True, True))


def test_the_gradient_is_that_of_the_softmax():
    logits = torch.tensor([0.3, -0.2, 0.9, 0.1], requires_grad=True)
    mask = torch.tensor([True, True, False, True])
    weight = torch.tensor([1.0, -2.0, 5.0, 0.5])
    action, hot = OneHotChoice(0.7)(logits, mask)
    assert action.item() == 0 and hot.tolist() == [1.0, 0.0, 0.0, 0.0]
    (got,) = torch.autograd.grad((weight * hot).sum(), logits)
    soft = torch.softmax(logits.masked_fill(~mask, -1e4) / 0.7, dim=-1)
    (wanted,) = torch.autograd.grad((weight * soft).sum(), logits)
    torch.testing.assert_close(got, wanted)


def test_gumbel_noise_draws_from_the_softmax():
    logits = torch.tensor([0.0, 1.0, -1.0, 2.0]).expand(20_000, 4)
    mask = torch.tensor([True, True, True, False]).expand(20_000, 4)
    with set_exploration_type(ExplorationType.RANDOM):
        action, _ = OneHotChoice(1.0)(logits, mask)
    shares = torch.bincount(action, minlength=4) / 20_000
    # Standard errors below 0.0034; 4 of them, false alarm 2e-4.
    torch.testing.assert_close(shares[:3], torch.softmax(logits[0, :3], 0), atol=0.0136, rtol=0.0)
    assert shares[3] == 0


def test_a_central_critic_reads_the_joint_action(make_small_env):
    env = make_small_env(1)
    learner = Ddpg(central_critic=True, warm_up=1, capacity=3, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    critic = learner.loss.value_network
    before = critic(data.clone())[STATE_ACTION_VALUE]
    other = data.clone()
    other[ACTION_ONE_HOT][:, 1] = other[ACTION_ONE_HOT][:, 1].roll(1, -1)
    assert (critic(other)[STATE_ACTION_VALUE][:, 0] != before[:, 0]).all()


def test_the_targets_of_actor_and_critic_follow(make_small_env):
    env = make_small_env(1)
    learner = Ddpg(tau=0.75, warm_up=1, capacity=3, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    sources = [getattr(learner.loss, f"{name}_network_params") for name in ("actor", "value")]
    targets = [getattr(learner.loss, f"target_{name}_network_params") for name in ("actor", "value")]
    with torch.no_grad():
        for value, networks in ((1.0, sources), (0.0, targets)):
            for network in networks:
                network.apply_(lambda weight, value=value: weight.data.fill_(value))
    learner.after_step(data)
    for value, networks in ((1.0, sources), (0.75, targets)):
        assert all((weight == value).all() for network in networks for weight in network.values(True, True))


def test_a_share_of_the_actions_is_drawn_and_the_memory_holds_what_was_done(make_small_env):
    env = make_small_env(64)
    learner = Ddpg(epsilon=0.8, epsilon_until=0.5, warm_up=1, capacity=256, minibatch_size=3).build(env, SMALL, 256)
    assert [learner.schedule(p)["rollout/exploration_rate"] for p in (0.5, 0.0)] == pytest.approx([0.05, 0.8])
    for weight in learner.policy.parameters():
        weight.data.zero_()
    over_canonical(learner.policy.module[0]).module.body[-1].bias.data[10] = 100.0  # stays, whatever the noise
    with torch.no_grad():
        batch = env.rollout(4, learner.explore, break_when_any_done=False)
    # 512 actions, all but a share 0.8 (1 - 1 / open actions) of them stay; at 4 to 11 open ones 0.6 to 0.73, +- 0.09.
    moved = (batch[ACTION] != 10).float().mean()
    assert 0.5 < moved < 0.83
    assert torch.equal(batch[ACTION_ONE_HOT], one_hot(batch[ACTION], 11).float())
    learner.store(batch)
    assert torch.equal(learner.keeps["replay"].buffer[:][ACTION_ONE_HOT], batch[ACTION_ONE_HOT].flatten(0, 1))
