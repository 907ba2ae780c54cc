"""One world in four views: WildfireEnv, PettingZoo's, Gymnasium's and Gymnasium's vector."""

from functools import lru_cache

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from warp_torchrl import make_env
from warp_torchrl.api.adapters import FireExtinguishingVectorEnv, gym_env, parallel_env

SEED, HORIZON = 7, 5
ACTIONS = np.random.default_rng(0).integers(0, 10, size=2 * HORIZON).tolist()
"""Of two episodes."""


@lru_cache
def of_torchrl(observation):
    env = make_env("single", n_worlds=1, seed=SEED, overrides=[f"horizon={HORIZON}", f"observation={observation}"])
    records = []
    for step, action in enumerate(ACTIONS):
        if step % HORIZON == 0:
            records.append((seen_by_agent(env.reset()), 0.0))
        now = env.step(TensorDict({"agents": {"action": torch.tensor([[action]])}}, batch_size=[1]))["next"]
        records.append((seen_by_agent(now), now["agents", "reward"].item()))
    assert now["done"].all()
    return records


def seen_by_agent(now, agent=0):
    seen = now["agents", "observation"]
    if isinstance(seen, torch.Tensor):
        return {"": seen[0, agent].numpy()}
    entries = {name: value[0, agent].numpy() for name, value in seen.items()}
    return {**entries, "action_mask": now["agents", "action_mask"][0, agent].to(torch.int8).numpy()}


def of_parallel(**options):
    env = parallel_env("single", **options)
    for step, action in enumerate(ACTIONS):
        if step % HORIZON == 0:
            yield env.reset(seed=SEED if step == 0 else None)[0]["bulldozer_0"], 0.0
        seen, reward, *_ = env.step({"bulldozer_0": action})
        yield seen["bulldozer_0"], reward["bulldozer_0"]


def of_gymnasium(**options):
    env = gym_env("single", **options)
    for step, action in enumerate(ACTIONS):
        if step % HORIZON == 0:
            yield env.reset(seed=SEED if step == 0 else None)[0], 0.0
        seen, reward, *_ = env.step(action)
        yield seen, reward


def of_vector(**options):
    """World 2 of three; the step after an episode's end is the reset."""
    env = FireExtinguishingVectorEnv(3, "single", **options)
    yield of_world(env.reset(seed=SEED - 2)[0], 2), 0.0
    for action in [*ACTIONS[:HORIZON], 0, *ACTIONS[HORIZON:]]:
        seen, reward, *_ = env.step(np.array([0, 3, action]))
        yield of_world(seen, 2), reward[2]


def of_world(seen, world):
    return {name: value[world] for name, value in seen.items()} if isinstance(seen, dict) else seen[world]


@pytest.mark.parametrize("view", [of_parallel, of_gymnasium, of_vector], ids=lambda view: view.__name__)
@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_the_same_seed_and_actions_give_the_same_to_the_bit(view, observation):
    expected, got = of_torchrl(observation), list(view(horizon=HORIZON, observation=observation))
    assert len(got) == len(expected) == len(ACTIONS) + 2 and any(reward for _, reward in got)
    for (seen, reward), (others, other_reward) in zip(expected, got):
        others = others if isinstance(others, dict) else {"": others}
        assert reward == other_reward and seen.keys() == others.keys()
        assert all(same_bits(seen[name], others[name]) for name in seen)


def same_bits(one, other):
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def test_a_mixed_team_is_the_same_in_both_views_of_teams():
    ours, theirs = make_env("hetero", n_worlds=1, seed=3), parallel_env("hetero", seed=3)
    now, (seen, _) = ours.reset(), theirs.reset()
    names = theirs.possible_agents
    assert names == ours.agent_names and {name.rpartition("_")[0] for name in names} == {"bulldozer", "uav"}
    for step in range(6):
        action = torch.arange(step, step + len(names))[None] % 10
        now = ours.step(TensorDict({"agents": {"action": action}}, batch_size=[1]))["next"]
        seen, reward, _, _, info = theirs.step(dict(zip(names, action[0].tolist())))
        assert list(reward.values()) == now["agents", "reward"][0, :, 0].tolist()
        assert same_bits(theirs.state(), now["state"][0].numpy())
        for index, name in enumerate(names):
            expected = seen_by_agent(now, index)
            assert all(same_bits(expected[entry], seen[name][entry]) for entry in expected)
            assert {entry: value.item() for entry, value in now["info"].items()} == info[name]
