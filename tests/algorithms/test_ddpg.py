"""DDPG's losses by hand, and the one-hot action that lets gradients through."""

import math

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch.distributions import Categorical
from torch.nn.functional import one_hot, smooth_l1_loss
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import DDPGLoss, ValueEstimators

from tests.algorithms.test_dqn import three_transitions
from warp_torchrl.algorithms.ddpg import Ddpg, OneHotChoice, PenalisedDdpg
from warp_torchrl.models import ACTION, ACTION_MASK, ACTION_ONE_HOT, LOGITS, STATE_ACTION_VALUE, Mlp, over_canonical

SMALL = Mlp(actor_hidden=(8,), critic_hidden=(8,))


@pytest.mark.parametrize("central", [False, True])
def test_the_losses_by_hand(make_small_env, central):
    env = make_small_env(1)
    algorithm = Ddpg(central_critic=central, gamma=0.9, logit_penalty=0.25, warm_up=1, capacity=3, minibatch_size=3)
    learner = algorithm.build(env, SMALL, 3)
    loss = learner.loss
    for weight in over_canonical(learner.policy.module[0]).module.body[-1].parameters():
        weight.data.mul_(300.0)  # young logits are next to nothing; the target actor's choice is the same
    data = three_transitions(env, learner)

    def logits_of(entries):
        actor = over_canonical(learner.policy.module[0], restored=True)
        return actor(entries.select(*actor.in_keys).clone())[LOGITS]

    def choice(entries):
        return one_hot(logits_of(entries).masked_fill(~entries[ACTION_MASK], -torch.inf).argmax(-1), 11).float()

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
        logits, mask = logits_of(data), data[ACTION_MASK]
        shares = torch.softmax(logits.masked_fill(~mask, -torch.inf), -1)
        pairs = zip(logits.flatten(0, 1), mask.flatten(0, 1), strict=True)
        penalty = 0.25 * torch.stack([each[open_].square().mean() for each, open_ in pairs]).mean()
    terms = loss(data)
    torch.testing.assert_close(terms["loss_value"].detach(), smooth_l1_loss(said, wanted))
    torch.testing.assert_close(terms["loss_actor"].detach(), penalty - best.mean())
    torch.testing.assert_close(terms["entropy"], Categorical(shares).entropy().mean())
    assert penalty > 0.01 and not mask.all()
    terms["loss_actor"].backward()
    assert all(
        weight.grad.abs().sum() > 0 for weight in loss.actor_network_params.values(True, True) if weight.ndim > 1
    )
    assert all(weight.grad is None for weight in loss.value_network_params.values(True, True))


class Logits(torch.nn.Module):
    """An actor whose logits are its parameters, whatever it sees."""

    def __init__(self, logits):
        super().__init__()
        self.logits = torch.nn.Parameter(torch.tensor(logits))

    def forward(self, seen):
        return self.logits.expand(*seen.shape[:-1], -1)


def loss_of(logits, worth, kind=PenalisedDdpg, **options):
    """DDPG's loss of an actor with these logits, against a critic that values each action as said."""
    choose = TensorDictModule(OneHotChoice(1.0), in_keys=[LOGITS, ACTION_MASK], out_keys=[ACTION, ACTION_ONE_HOT])
    actor = TensorDictSequential(TensorDictModule(Logits(logits), in_keys=["seen"], out_keys=[LOGITS]), choose)
    critic = torch.nn.Linear(len(worth), 1, bias=False)
    critic.weight.data[:] = torch.tensor(worth)
    critic = TensorDictModule(critic, in_keys=[ACTION_ONE_HOT], out_keys=[STATE_ACTION_VALUE])
    loss = kind(actor, critic, delay_actor=True, delay_value=True, **options)
    loss.set_keys(state_action_value=STATE_ACTION_VALUE, reward="reward", done="done", terminated="done")
    loss.make_value_estimator(ValueEstimators.TD0, gamma=0.9)
    return loss


def sample(*masks):
    """Steps of one agent that did its first action, by their masks."""
    count = len(masks)
    entries = {
        "seen": torch.zeros(count, 1, 1),
        ACTION_MASK: torch.tensor(masks, dtype=torch.bool).unflatten(0, (count, 1)),
        "reward": torch.linspace(0.0, 1.0, count).reshape(count, 1, 1),
        "done": torch.zeros(count, 1, 1, dtype=torch.bool),
    }
    entries |= {ACTION_ONE_HOT: one_hot(torch.zeros(count, 1, dtype=torch.long), len(masks[0])).float()}
    return TensorDict({**entries, "next": TensorDict(entries, [count])}, [count])


def test_the_penalty_is_the_mean_square_of_the_open_actions_logits():
    # (1 + 4 + 9) / 3 and (4 + 9) / 2 = 14/3 and 13/2; their mean, 67/12, times 0.12 is 0.67. Action 2 is worth 5.
    loss = loss_of([1.0, -2.0, 3.0, 70.0], [0.0, 0.0, 5.0, 0.0], logit_penalty=0.12)
    terms = loss(sample([1, 1, 1, 0], [0, 1, 1, 0]))
    assert terms["loss_actor"].item() == pytest.approx(-5.0 + 0.67)
    terms["loss_actor"].backward()
    gradient = next(loss.actor_network_params.values(True, True)).grad
    assert gradient[3] == 0.0, "a masked action's logit does not count"
    assert all(weight.grad is None for weight in loss.value_network_params.values(True, True))


def test_a_sample_s_penalty_weighs_what_its_loss_weighs():
    # As above, where the first step of the two has three quarters of the weight: (3 x 14/3 + 13/2) / 4 x 0.12 = 0.615.
    loss = loss_of([1.0, -2.0, 3.0, 70.0], [0.0, 0.0, 5.0, 0.0], logit_penalty=0.12)
    data = sample([1, 1, 1, 0], [0, 1, 1, 0]).set("priority_weight", torch.tensor([[3.0], [1.0]]))
    assert loss(data)["loss_actor"].item() == pytest.approx(-5.0 + 0.615)


def test_the_entropy_is_that_of_what_gumbel_noise_draws_from():
    # Two open actions with logits 0 and ln 3: shares 1/4 and 3/4. One open action alone: certain.
    loss = loss_of([0.0, math.log(3.0), 9.0], [0.0] * 3, logit_penalty=0.0)
    share = -(0.25 * math.log(0.25) + 0.75 * math.log(0.75))
    assert loss(sample([1, 1, 0]))["entropy"].item() == pytest.approx(share)
    assert loss(sample([1, 1, 0], [0, 1, 0]))["entropy"].item() == pytest.approx(share / 2)


def test_the_penalty_leaves_the_value_s_loss_and_without_it_all_is_torchrl_s():
    logits, worth, data = [1.0, -2.0, 3.0], [0.3, -0.1, 0.8], sample([1, 1, 1], [1, 1, 0])
    theirs = loss_of(logits, worth, DDPGLoss)(data.clone())
    for penalty, same in ((0.0, True), (0.5, False)):
        ours = loss_of(logits, worth, logit_penalty=penalty)(data.clone())
        assert ours["loss_value"] == theirs["loss_value"] > 0.0
        assert (ours["loss_actor"] == theirs["loss_actor"]).item() is same


def test_a_certain_actor_comes_back_with_the_penalty_alone():
    """The actor is sure of the first action, the second is worth more: no gradient comes through the softmax."""
    data, found = sample([1, 1, 1]), {}
    for penalty in (0.0, 1e-3):
        loss = loss_of([60.0, -60.0, 0.0], [0.0, 1.0, 0.0], logit_penalty=penalty)
        (logits,) = loss.actor_network_params.values(True, True)
        optimizer = torch.optim.Adam([logits], lr=1.0)
        for _ in range(150):
            loss.loss_actor(data)[0].backward()
            optimizer.step()
            optimizer.zero_grad()
        found[penalty] = logits.argmax().item(), logits.abs().max().item()
    assert found[0.0] == (0, 60.0)
    assert found[1e-3][0] == 1 and found[1e-3][1] < 10.0


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
