"""PPO's keys, shapes, advantages and updates."""

import pytest
import torch
from torchrl.collectors import Collector
from torchrl.objectives.value import MultiAgentGAE

from tests.conftest import small_world
from warp_torchrl.algorithms.held_batch import ADVANTAGE, VALUE_TARGET, narrowed, with_advantages
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env.observation import Paper, Surroundings
from warp_torchrl.models import CANONICAL_STATE, REWARD, STATE, VALUE, CanonicalBatch, Cnn, Mlp, signature


def collected(env, learner, steps):
    collector = Collector(
        env,
        learner.explore,
        frames_per_batch=steps * env.batch_size[0],
        total_frames=-1,
        track_traj_ids=False,
        auto_register_policy_transforms=False,
    )
    batch = next(iter(collector))
    collector.shutdown()
    return batch


@pytest.mark.parametrize("central", [True, False])
def test_advantages_have_a_value_for_each_agent(make_small_env, central):
    env = make_small_env(4)
    learner = Ppo(central_critic=central).build(env, Mlp(actor_hidden=(16,), critic_hidden=(16,)), 32)
    batch = collected(env, learner, 8)
    prepared = with_advantages(learner.loss, batch, Mlp().canonical_batch(signature(env), state=central))
    assert prepared.batch_size == (32,)
    assert prepared[ADVANTAGE].shape == prepared[VALUE_TARGET].shape == (32, 2, 1)
    assert not {"next", "info"} & set(prepared.keys())


@pytest.mark.parametrize(("model", "observation"), [(Mlp, Surroundings()), (Mlp, Paper()), (Cnn, Surroundings())])
def test_a_state_kept_in_half_precision_changes_no_bit_of_what_is_learnt(make_small_env, model, observation):
    env = make_small_env(3, observation=observation)
    learner = Ppo(minibatch_size=12).build(env, model(dtype="bfloat16", symmetry="none"), 12)
    wide = with_advantages(learner.loss, collected(env, learner, 4), CanonicalBatch(None))
    narrow = narrowed(wide, torch.bfloat16)
    assert narrow[STATE].dtype == torch.bfloat16 != wide[STATE].dtype
    found = []
    for batch in (wide, narrow):
        terms = learner.loss(batch.copy())
        sum(terms[key] for key in learner.loss_keys).backward()
        found.append([parameter.grad.clone() for parameter in learner.loss.parameters() if parameter.requires_grad])
        learner.optimizer.zero_grad()
    assert all(torch.equal(one, other) for one, other in zip(*found, strict=True))


def test_what_is_learnt_from_is_kept_as_the_networks_compute(make_small_env):
    env, kept = make_small_env(3), {}
    for dtype in ("float32", "bfloat16"):
        learner = Ppo(epochs=1, minibatch_size=12).build(env, Mlp(dtype=dtype, actor_hidden=(8,)), 12)
        learner.store(collected(env, learner, 4))
        kept[dtype] = next(iter(learner.samples()))[CANONICAL_STATE].dtype
    assert kept == {"float32": torch.float32, "bfloat16": torch.bfloat16}


def test_who_remembers_learns_from_whole_sequences(make_small_env):
    # Six worlds of eight steps each: 20 steps a minibatch are two sequences.
    env, model = make_small_env(6), Mlp(memory=8, actor_hidden=(8,), critic_hidden=(8,))
    learner = Ppo(minibatch_size=20, epochs=1).build(env, model, 48)
    learner.store(collected(env, learner, 8))
    assert [tuple(sample.batch_size) for sample in learner.samples()] == [(2, 8)] * 3


def test_gae_by_hand():
    """Three steps, reward 1 each, values 0.5, gamma 0.5, lambda 0.5; the episode terminates at the last.

    delta_2 = 1 - 0.5 = 0.5;               A_2 = 0.5
    delta_1 = 1 + 0.25 - 0.5 = 0.75;       A_1 = 0.75 + 0.25 x 0.5 = 0.875
    delta_0 = 0.75;                        A_0 = 0.75 + 0.25 x 0.875 = 0.96875
    Cut at the horizon instead (truncated), the last value still counts: delta_2 = 0.75, A_2 = 0.75.
    """
    from warp_torchrl import WildfireEnv

    env = WildfireEnv(small_world(), n_worlds=2)
    learner = Ppo(gamma=0.5, lmbda=0.5, value_norm=False).build(env, Mlp(critic_hidden=(4,)), 6)
    for parameter in learner.loss.critic_network_params.flatten_keys().values():
        parameter.data.zero_()
    bias = [
        value for key, value in learner.loss.critic_network_params.flatten_keys(".").items() if key.endswith("bias")
    ]
    bias[-1].data.fill_(0.5)
    batch = collected(env, learner, 3)
    batch["next", "agents", "reward"].fill_(1.0)
    for flag in ("done", "terminated", "truncated"):
        batch["next", flag].zero_()
    batch["next", "done"][:, -1] = True
    batch["next", "terminated"][0, -1] = True
    batch["next", "truncated"][1, -1] = True
    advantage = with_advantages(learner.loss, batch, Mlp().canonical_batch(signature(env)))[ADVANTAGE].view(2, 3, 2)
    assert advantage[0, :, 0].tolist() == pytest.approx([0.96875, 0.875, 0.5], abs=1e-5)
    assert advantage[1, -1, 0].item() == pytest.approx(0.75, abs=1e-5)
    assert (advantage[..., 0] == advantage[..., 1]).all()


def test_one_pass_of_the_critic_values_what_two_would(make_small_env):
    """Episodes end at the horizon of 5 and the batch at 8: what a step led to is not always the next step's state."""
    env = make_small_env(6, small_world(horizon=5))
    learner = Ppo().build(env, Mlp(actor_hidden=(8,), critic_hidden=(8,), dtype="float32"), 48)
    batch, loss = collected(env, learner, 8), learner.loss
    assert int(batch["next", "done"][:, :-1].sum()) > 0, "an episode ends before the batch does"
    canonical = Mlp().canonical_batch(signature(env))
    two = MultiAgentGAE(gamma=0.99, lmbda=0.95, value_network=loss.critic_network)
    two.set_keys(value=VALUE, reward=REWARD, done="done", terminated="terminated", advantage=ADVANTAGE)
    two.set_keys(value_target=VALUE_TARGET)
    with torch.no_grad():
        both = canonical(batch).set("next", canonical(batch["next"]))
        twice = two(both, params=loss.critic_network_params, target_params=loss.target_critic_network_params)
    once = with_advantages(loss, batch.clone(), canonical).view(6, 8)
    for key in (ADVANTAGE, VALUE_TARGET):
        torch.testing.assert_close(once[key], twice[key], rtol=1e-5, atol=1e-6)


def test_the_schedule_falls_linearly(make_small_env):
    env = make_small_env(2)
    learner = Ppo(learning_rate=1e-3, learning_rate_end=0.1, entropy_coeff=0.01, entropy_coeff_end=0.0).build(
        env, Mlp(actor_hidden=(8,), critic_hidden=(8,)), 8
    )
    assert learner.schedule(0.0)["train/learning_rate"] == pytest.approx(1e-3)
    row = learner.schedule(0.5)
    assert row["train/learning_rate"] == pytest.approx(5.5e-4)
    assert learner.optimizer.param_groups[0]["lr"] == pytest.approx(5.5e-4)
    assert float(learner.loss.entropy_coeff) == pytest.approx(0.005)


def test_the_critic_learns_alone_at_first(make_small_env):
    env = make_small_env(4)
    learner = Ppo(critic_first=0.5).build(env, Mlp(actor_hidden=(8,), critic_hidden=(8,)), 32)
    learner.store(collected(env, learner, 8))

    def moved(progress):
        learner.schedule(progress)
        before = {name: each.detach().clone() for name, each in learner.loss.named_parameters()}
        terms = learner.loss(next(iter(learner.samples())))
        sum(terms[key] for key in learner.loss_keys).backward()
        learner.optimizer.step()
        learner.optimizer.zero_grad()
        after = learner.loss.named_parameters()
        return {name.split("_")[0] for name, each in after if not torch.equal(each, before[name])}

    assert [moved(0.0), moved(0.49), moved(0.5)] == [{"critic"}, {"critic"}, {"actor", "critic"}]


def test_a_few_updates_raise_the_return_of_a_bandit(make_small_env):
    """Reward 1 for one action and nothing else: the policy must find it in a few dozen updates."""
    env = make_small_env(16, small_world(horizon=400))
    learner = Ppo(learning_rate=3e-3, minibatch_size=64).build(env, Mlp(actor_hidden=(32,), critic_hidden=(32,)), 128)
    now = env.reset()[:, None].expand(16, 8)
    wanted = 10  # stay, which is always open
    flags = {name: torch.ones(16, 8, 1, dtype=torch.bool) for name in ("done", "terminated")}
    shares = []
    for _ in range(20):
        with torch.no_grad():
            batch = learner.policy(now.clone())
        following = now.clone().update({**flags, "truncated": ~flags["done"]})
        following["agents", "reward"] = (batch["agents", "action"] == wanted).float()[..., None]
        batch["next"] = following
        shares.append(batch["next", "agents", "reward"].mean().item())
        learner.store(batch)
        for sample in learner.samples():
            terms = learner.loss(sample)
            sum(terms[key] for key in learner.loss_keys).backward()
            learner.optimizer.step()
            learner.optimizer.zero_grad()
    assert shares[0] < 0.7 and shares[-1] > 0.95


@pytest.mark.parametrize(
    ("field", "value"), [("gamma", 1.1), ("clip_epsilon", 0.0), ("epochs", 0), ("learning_rate", -1.0)]
)
def test_values_out_of_range_are_refused(field, value):
    with pytest.raises(ValueError, match=f"{field} must be in"):
        Ppo(**{field: value})


def test_the_critic_reads_the_state_unless_it_is_told_not_to(make_small_env):
    env, model = make_small_env(2), Mlp(actor_hidden=(8,), critic_hidden=(8,))
    reads = [
        CANONICAL_STATE in each.build(env, model, 8).loss.critic_network.in_keys
        for each in (Ppo(), Ppo(central_critic=False))
    ]
    assert reads == [True, False]


def test_the_critic_is_not_part_of_the_policy(make_small_env):
    env = make_small_env(2)
    learner = Ppo().build(env, Mlp(actor_hidden=(8,), critic_hidden=(8,)), 8)
    out = learner.policy(env.reset())
    assert VALUE not in out.keys(True, True)
