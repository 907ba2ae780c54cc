"""Q-learning's targets by hand, mixers, epsilon, and what moves the target networks."""

import pytest
import torch
from tensordict import TensorDict
from torch.nn.functional import smooth_l1_loss

from warp_torchrl.algorithms.ddpg import Ddpg
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.sac import Sac
from warp_torchrl.models import ACTION, ACTION_MASK, ACTION_VALUE, REWARD, Mlp, over_canonical
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain

SMALL = Mlp(actor_hidden=(8,), critic_hidden=(8,))


def three_transitions(env, learner):
    """Three steps of one world: a common one, one cut by the horizon, one at which the episode terminates."""
    with torch.no_grad():
        batch = env.rollout(3, learner.explore, break_when_any_done=False)[:1].contiguous()
    batch["next", *REWARD] = torch.tensor([[[[0.5], [1.0]], [[-1.0], [0.0]], [[2.0], [3.0]]]])
    batch["next", "done"] = torch.tensor([[[False], [True], [True]]])
    batch["next", "terminated"] = torch.tensor([[[False], [False], [True]]])
    learner.store(batch)
    return learner.keeps["replay"].buffer[:]


def values(learner, params, data):
    """The action values [3, 2, 11] of a set of parameters, as a plain network gives them."""
    loss = learner.loss
    with params.to_module(loss.value_network if hasattr(loss, "value_network") else loss.local_value_network):
        network = over_canonical(learner.policy.module[0], restored=True)
        return network(data.select(*network.in_keys).clone())[ACTION_VALUE]


@pytest.mark.parametrize("double_q", [True, False])
def test_the_loss_of_q_learning_by_hand(make_small_env, double_q):
    env = make_small_env(1)
    learner = Dqn(gamma=0.9, warm_up=1, capacity=3, minibatch_size=3, tau=0.5, double_q=double_q).build(env, SMALL, 3)
    online = learner.loss.value_network_params
    target = learner.loss.target_value_network_params
    target.apply_(lambda weight: weight.data.mul_(0.5))  # so that it matters who chooses and who judges
    data = three_transitions(env, learner)
    with torch.no_grad():
        following = data["next"]
        chooses = online if double_q else target
        choice = values(learner, chooses, following).masked_fill(~following[ACTION_MASK], -torch.inf).argmax(-1)
        judged = values(learner, target, following).gather(-1, choice[..., None])[..., 0]
        reward = torch.tensor([[0.5, 1.0], [-1.0, 0.0], [2.0, 3.0]])
        goes_on = torch.tensor([[1.0], [1.0], [0.0]])  # cut by the horizon, the future still counts
        wanted = reward + 0.9 * goes_on * judged
        said = values(learner, online, data).gather(-1, data[ACTION][..., None])[..., 0]
    terms = learner.loss(data)
    torch.testing.assert_close(terms["loss"].detach(), smooth_l1_loss(said, wanted))


def test_double_q_is_of_values_that_are_not_mixed():
    with pytest.raises(ValueError, match="double_q must be true where values are mixed"):
        Dqn(mixer="qmix", double_q=False)


@pytest.mark.parametrize("mixer", ["vdn", "qmix"])
def test_the_team_s_value_is_learnt_from_the_mean_reward(make_small_env, mixer):
    env = make_small_env(1)
    learner = Dqn(mixer=mixer, gamma=0.9, warm_up=1, capacity=3, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    loss = learner.loss

    def mixed(chosen, state):
        if mixer == "vdn":
            return chosen.sum(-1)
        with loss.mixer_network_params.to_module(loss.mixer_network):
            return loss.mixer_network.module(chosen[..., None], state)[..., 0]

    with torch.no_grad():  # the target networks are still copies
        following = data["next"]
        best = values(learner, loss.local_value_network_params, following)
        best = best.masked_fill(~following[ACTION_MASK], -torch.inf).amax(-1)
        state = following["canonical_state"] if mixer == "qmix" else None
        wanted = torch.tensor([0.75, -0.5, 2.5]) + 0.9 * torch.tensor([1.0, 1.0, 0.0]) * mixed(best, state)
        said = values(learner, loss.local_value_network_params, data).gather(-1, data[ACTION][..., None])[..., 0]
        said = mixed(said, data["canonical_state"] if mixer == "qmix" else None)
    torch.testing.assert_close(loss(data)["loss"].detach(), smooth_l1_loss(said, wanted))


@pytest.mark.parametrize("mixer", ["none", "vdn"])
def test_returns_over_two_steps_by_hand(make_small_env, mixer):
    """Of three steps the first sums two rewards and leads to the third; the others end with an episode, by the horizon
    and for good.
    """
    env = make_small_env(1)
    learner = Dqn(mixer=mixer, gamma=0.9, warm_up=1, capacity=3, minibatch_size=3, n_step=2).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    rewards = {
        "none": [[0.5 - 0.9 * 1.0, 1.0 + 0.9 * 0.0], [-1.0, 0.0], [2.0, 3.0]],
        "vdn": [0.75 - 0.9 * 0.5, -0.5, 2.5],
    }[mixer]
    key = REWARD if mixer == "none" else "team_reward"
    reward = torch.tensor(rewards)
    torch.testing.assert_close(data["next"].get(key)[..., 0], reward)
    steps = torch.tensor([2.0, 1.0, 1.0])
    assert torch.equal(data["steps_to_next_obs"].reshape(3, -1), steps[:, None].expand(3, reward[0].numel()))
    ends = data["next", "agents"] if mixer == "none" else data["next"]
    assert ends["terminated"].reshape(3, -1)[:, 0].tolist() == [False, False, True]
    assert ends["done"].reshape(3, -1)[:, 0].tolist() == [True, True, True]  # the first leads to the horizon's end

    loss = learner.loss
    with torch.no_grad():  # the target networks are still copies
        params = loss.value_network_params if mixer == "none" else loss.local_value_network_params
        best = values(learner, params, data["next"]).masked_fill(~data["next"][ACTION_MASK], -torch.inf).amax(-1)
        said = values(learner, params, data).gather(-1, data[ACTION][..., None])[..., 0]
        if mixer == "vdn":
            best, said = best.sum(-1), said.sum(-1)
        discount = torch.tensor([0.81, 0.9, 0.0]).reshape(3, *[1] * (best.ndim - 1))
        wanted = reward + discount * best
    torch.testing.assert_close(loss(data)["loss"].detach(), smooth_l1_loss(said, wanted))


def test_several_steps_need_a_discount():
    with pytest.raises(ValueError, match="n_step must be 1 where gamma is 0, got 3"):
        Dqn(gamma=0.0, n_step=3)


@pytest.mark.parametrize("algorithm", [Sac, Ddpg])
def test_targets_of_actors_and_critics_discount_by_the_steps_too(make_small_env, algorithm):
    env = make_small_env(1)
    learner = algorithm(gamma=0.9, warm_up=1, capacity=3, minibatch_size=3, n_step=2).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    value = torch.ones(3, 2, 1)
    target = learner.loss.value_estimator.value_estimate(data, next_value=value)
    wanted = data["next", *REWARD] + torch.tensor([0.81, 0.9, 0.0]).view(3, 1, 1)
    torch.testing.assert_close(target, wanted)


def test_what_follows_several_steps_is_seen_later(make_small_env):
    env = make_small_env(1)
    learner = Dqn(warm_up=1, capacity=3, minibatch_size=3, n_step=2).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    for name, now in data["next", "agents"].items():
        if name not in ("reward", "done", "terminated"):
            assert torch.equal(now[0], now[1]), name


def test_qmix_never_falls_when_an_agent_s_value_rises(make_small_env):
    env = make_small_env(8)
    mixer = Dqn(mixer="qmix").build(env, SMALL, 8).loss.mixer_network
    state, own = env.reset()["state"], torch.randn(8, 2, 1)
    now = TensorDict({("agents", "chosen_action_value"): own, "canonical_state": state}, [8])
    low = mixer(now.clone())["chosen_action_value"]
    for agent in range(2):
        raised = own.clone()
        raised[:, agent] += 1.0
        now["agents", "chosen_action_value"] = raised
        assert (mixer(now.clone())["chosen_action_value"] > low).all()


@pytest.mark.parametrize(
    ("interval", "steps", "shares"), [(0, 3, [0.75, 0.9375, 0.984375]), (3, 7, [0, 0, 1, 1, 1, 1, 1])]
)
def test_target_networks_follow_softly_or_are_copied(make_small_env, interval, steps, shares):
    """At tau 0.75 the distance shrinks to a quarter each step; with an interval of 3 the copy comes at the third."""
    env = make_small_env(1)
    learner = Dqn(target_interval=interval, tau=0.75, capacity=3, warm_up=1, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    source, target = learner.loss.value_network_params, learner.loss.target_value_network_params
    with torch.no_grad():
        source.apply_(lambda weight: weight.data.fill_(1.0))
        target.apply_(lambda weight: weight.data.fill_(0.0))
    for share in shares[:steps]:
        learner.after_step(data)
        for weight in target.values(True, True):
            torch.testing.assert_close(weight, torch.full_like(weight, share))


def test_epsilon_falls_to_its_end_and_is_the_share_of_random_actions(make_small_env):
    env = make_small_env(512)
    learner = Dqn(epsilon=0.8, epsilon_end=0.2, epsilon_until=0.5, capacity=10_000).build(env, SMALL, 512)
    assert [learner.schedule(p)["rollout/exploration_rate"] for p in (0.0, 0.25, 0.5, 1.0)] == pytest.approx(
        [0.8, 0.5, 0.2, 0.2]
    )
    learner.schedule(0.25)
    now = env.reset()
    greedy = learner.policy.module[1](learner.policy.module[0](now.clone()))[ACTION]
    done = torch.stack([learner.explore(now.clone())[ACTION] for _ in range(20)])
    open_actions = now[ACTION_MASK].sum(-1)
    expected = (0.5 * (1.0 - 1.0 / open_actions)).mean().item()  # a random action may be the greedy one
    # 20 480 draws, standard error 0.0035; 4 of them, false alarm 6e-5.
    assert (done != greedy).float().mean().item() == pytest.approx(expected, abs=0.014)


def test_nothing_is_learnt_before_the_memory_is_warm(make_small_env):
    env = make_small_env(4)
    learner = Dqn(warm_up=48, capacity=64, minibatch_size=16, updates=5).build(env, SMALL, 32)
    counts = []
    for _ in range(3):
        with torch.no_grad():
            learner.store(env.rollout(8, learner.explore, break_when_any_done=False))
        counts.append((len(learner.keeps["replay"].buffer), len(list(learner.samples()))))
    assert counts == [(32, 0), (64, 5), (64, 5)]


def test_a_memory_is_restored_with_its_order_and_its_room(make_small_env):
    env = make_small_env(4)
    learners = [Dqn(warm_up=1, capacity=80, minibatch_size=16).build(env, SMALL, 32) for _ in range(2)]
    with torch.no_grad():
        batches = [env.rollout(8, learners[0].explore, break_when_any_done=False) for _ in range(4)]
    for count in (1, 3):  # not yet full, and gone round
        first, second = learners
        first.keeps["replay"].buffer.empty()
        for batch in batches[:count]:
            first.store(batch.clone())
        state = first.keeps["replay"].state_dict()
        assert all(len(each) == min(32 * count, 80) for each in state["_storage"].values())
        second.keeps["replay"].load_state_dict(state)
        for learner in learners:
            learner.store(batches[3].clone())
        assert len(first.keeps["replay"].buffer) == len(second.keeps["replay"].buffer)
        ours, theirs = first.keeps["replay"].buffer[:], second.keeps["replay"].buffer[:]
        assert (ours == theirs).all() and ours["agents"].batch_size == theirs["agents"].batch_size


def test_prioritised_replay_works_or_says_why_not(make_small_env):
    env = make_small_env(4)
    try:
        algorithm = Dqn(replay="prioritised", warm_up=16, capacity=64, minibatch_size=16, updates=3)
    except ValueError as error:
        assert str(error).startswith("replay must be uniform here") and "\n" not in str(error)
        return
    learner = algorithm.build(env, SMALL, 32)
    with torch.no_grad():
        learner.store(env.rollout(8, learner.explore, break_when_any_done=False))
    for sample in learner.samples():
        learner.loss(sample)["loss"].backward()
        learner.after_step(sample)
    twin = algorithm.build(env, SMALL, 32)
    twin.keeps["replay"].load_state_dict(learner.keeps["replay"].state_dict())
    ours, theirs = learner.keeps["replay"].buffer.sample(), twin.keeps["replay"].buffer.sample()
    assert ours["priority_weight"].std() > 0 and torch.equal(ours["priority_weight"], theirs["priority_weight"])
    assert torch.equal(ours["index"], theirs["index"])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("gamma", 1.1),
        ("epsilon_end", 1.5),
        ("tau", 0.0),
        ("capacity", 0),
        ("capacity", 1.5),
        ("minibatch_size", 0),
        ("warm_up", 10**6),
        ("mixer", "sum"),
        ("replay", "ranked"),
    ],
)
def test_values_out_of_range_are_refused(field, value):
    with pytest.raises(ValueError, match=f"{field} must be"):
        Dqn(**{field: value})


def test_a_batch_must_fit_into_the_memory(make_small_env):
    with pytest.raises(ValueError, match="capacity must be at least a batch"):
        Dqn(capacity=16, warm_up=8).build(make_small_env(4), SMALL, 32)
    with pytest.raises(ConfigError, match=r"algorithm\.capacity must be at least a batch"):
        run_config(plain(compose_config("train", ["algorithm=dqn", "algorithm.warm_up=10", "algorithm.capacity=100"])))


def test_the_observation_is_kept_as_bytes(make_small_env):
    env = make_small_env(1)
    learner = Dqn(capacity=3, warm_up=1, minibatch_size=3).build(env, SMALL, 3)
    data = three_transitions(env, learner)
    view = ("agents", "canonical_view")
    assert data[view].dtype == data[("next", *view)].dtype == torch.uint8
    assert "state" not in data.keys() and "info" not in data["next"].keys()
