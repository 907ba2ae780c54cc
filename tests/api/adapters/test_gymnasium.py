"""The views as a Gymnasium Env and VectorEnv."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from warp_torchrl.api.adapters import FireExtinguishingEnv, FireExtinguishingVectorEnv, gym_env
from warp_torchrl.runs.config.construction import ConfigError

STAY = 10
BURNS_OUT = {"fire": "spread", "steps_per_tick": 1, "horizon": 12, "landscape.size": 8, "ignition.head_start": 0}
"""Small fires, which end at different steps."""


def vector(n_worlds=3, **options):
    return FireExtinguishingVectorEnv(n_worlds, **{"horizon": 5, **options})


@pytest.mark.filterwarnings("error::UserWarning", "ignore:.*Not able to test alternative render modes")
@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_gymnasium_finds_its_interface_kept(observation):
    check_env(gym_env(horizon=5, observation=observation, render_mode="rgb_array"))


@pytest.mark.filterwarnings("error::UserWarning")
def test_gymnasium_makes_it_by_name():
    env = gymnasium.make("Wildfire-v0", horizon=5, overrides=["fire=paper"], render_mode="rgb_array")
    assert isinstance(env.unwrapped, FireExtinguishingEnv)
    check_env(env.unwrapped, skip_render_check=True)
    env.reset()
    for _ in range(5):
        *_, terminated, truncated, _ = env.step(STAY)
    assert truncated and not terminated


def test_action_masks_are_the_observation_s():
    env = gym_env()
    seen, _ = env.reset()
    assert env.action_masks().dtype == bool and (env.action_masks() == seen["action_mask"]).all()


def test_without_a_seed_each_has_its_own_world():
    views = [gym_env().reset()[0]["view"] for _ in range(2)]
    assert (views[0] != views[1]).any()


@pytest.mark.parametrize("action", [11, -1, 0.0, "3", True, np.zeros(1), np.zeros(2, int), np.zeros((1, 1), int)])
def test_bad_actions_are_refused_in_one_line(single, action):
    with pytest.raises(ValueError, match="action must be") as error:
        single.step(action)
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def single():
    env = gym_env()
    env.reset()
    return env


def test_an_action_may_stand_in_an_array():
    rewards = []
    for action in (8, np.int64(8), np.array(8), np.array([8], np.int32)):
        env = gym_env(seed=3)
        env.reset()
        rewards.append(env.step(action)[1])
    assert len(set(rewards)) == 1


def test_an_unknown_keyword_is_a_type_error_as_of_any_function():
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'") as error:
        gym_env(frameskip=1)
    assert isinstance(error.value, ConfigError) and "\n" not in str(error.value)
    with pytest.raises(ConfigError, match="frameskip is not a key") as error:
        gym_env(overrides=["frameskip=1"])
    assert not isinstance(error.value, TypeError), "this is a text, and no keyword"
    with pytest.raises(ConfigError, match="horizon") as error:
        gym_env(horizon=-1)
    assert not isinstance(error.value, TypeError)


def test_what_is_seen_lies_within_its_space_through_episodes():
    env = gym_env("single", **BURNS_OUT)
    env.action_space.seed(0)
    for _ in range(3):
        seen, _ = env.reset()
        ended = False
        while not ended:
            assert seen in env.observation_space
            seen, _, terminated, truncated, _ = env.step(env.action_space.sample(seen["action_mask"]))
            ended = terminated or truncated
        assert seen in env.observation_space


def test_stepping_a_finished_world_or_one_never_started_is_refused():
    env = gym_env(horizon=1)
    with pytest.raises(RuntimeError, match=r"call reset\(\) first"):
        env.step(STAY)
    env.reset()
    env.step(STAY)
    with pytest.raises(RuntimeError, match="the episode has ended"):
        env.step(STAY)


@pytest.mark.parametrize("make", [gym_env, lambda scenario: vector(2, scenario=scenario)], ids=["env", "vector"])
def test_a_team_is_refused(make):
    with pytest.raises(ValueError, match=r"team\.n_agents must be 1 for Gymnasium, got 2 in skirmish"):
        make("skirmish")


def test_gymnasium_makes_a_batch_by_name():
    env = gymnasium.make_vec("Wildfire-v0", num_envs=3, vectorization_mode="vector_entry_point", horizon=5)
    assert isinstance(env.unwrapped, FireExtinguishingVectorEnv) and env.num_envs == 3
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, _ = env.reset(seed=1)
    assert seen in env.observation_space and env.action_space == gymnasium.spaces.MultiDiscrete([11] * 3)
    seen, reward, terminated, truncated, _ = env.step(env.action_space.sample())
    assert seen in env.observation_space
    assert (reward.dtype, terminated.dtype, truncated.dtype) == (np.float64, bool, bool)
    env.close()


@pytest.mark.parametrize(
    ("mode", "observation"),
    [
        (AutoresetMode.NEXT_STEP, "surroundings"),
        (AutoresetMode.SAME_STEP, "paper"),
        pytest.param(AutoresetMode.NEXT_STEP, "paper", marks=pytest.mark.slow),
        pytest.param(AutoresetMode.SAME_STEP, "surroundings", marks=pytest.mark.slow),
    ],
)
def test_worlds_start_anew_exactly_as_in_gymnasium_s_own_vector(mode, observation):
    options = {**BURNS_OUT, "observation": observation}
    ours = vector(3, autoreset_mode=mode, **options)
    theirs = SyncVectorEnv([lambda: gym_env(**options)] * 3, autoreset_mode=mode)
    assert theirs.metadata["autoreset_mode"] is ours.metadata["autoreset_mode"]
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    assert same(ours.reset(seed=7), theirs.reset(seed=7))
    ends, random = [], np.random.default_rng(0)
    for step in range(15):
        actions = random.integers(0, 11, size=3)
        mine, other = ours.step(actions), theirs.step(actions)
        assert same(mine, other), step
        ends += [(step, how) for how in (2, 3) for _ in range(mine[how].sum())]
    assert len({step for step, _ in ends}) > 1 and {how for _, how in ends} == {2, 3}, "out one by one, or out of time"


def same(ours, theirs):
    return all(data_equivalence(one, other, exact=True) for one, other in zip(ours, theirs, strict=True))


def test_gymnasium_makes_a_batch_that_starts_anew_in_the_same_step():
    batch = {"num_envs": 2, "vectorization_mode": "vector_entry_point"}
    env = gymnasium.make_vec("Wildfire-v0", **batch, horizon=1, autoreset_mode="SameStep")
    env.reset(seed=0)
    *_, truncated, infos = env.step(np.full(2, STAY))
    assert truncated.all() and infos["episode_length"].tolist() == [0.0, 0.0]
    assert infos["final_info"]["episode_length"].tolist() == [1.0, 1.0] and infos["_final_obs"].all()
    assert FireExtinguishingVectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


def test_an_episode_s_end_by_hand():
    env = vector(2, horizon=2)
    env.reset(seed=3)
    stay = np.full(2, STAY)
    env.step(stay)
    _, _, _, truncated, infos = env.step(stay)
    assert truncated.tolist() == [True, True] and infos["episode_length"].tolist() == [2.0, 2.0]
    _, reward, terminated, truncated, infos = env.step(np.zeros(2, int))  # the action is ignored
    assert reward.tolist() == [0.0, 0.0] and not terminated.any() and not truncated.any()
    assert infos["episode_length"].tolist() == [0.0, 0.0] and infos["_episode_length"].tolist() == [True, True]
    *_, infos = env.step(stay)
    assert infos["episode_length"].tolist() == [1.0, 1.0]


def test_gymnasium_s_statistics_of_episodes_fit():
    env = RecordEpisodeStatistics(vector(2, horizon=3))
    env.reset(seed=0)
    rewards = np.zeros(2)
    for _ in range(3):
        _, reward, _, _, infos = env.step(np.full(2, STAY))
        rewards += reward
    assert infos["episode"]["l"].tolist() == [3, 3] and infos["episode"]["r"] == pytest.approx(rewards)


def test_seeds_count_up_or_come_one_by_one():
    env = vector(3)
    counted, given = env.reset(seed=5)[0]["view"], env.reset(seed=[7, 6, 5])[0]["view"]
    assert (counted == given[::-1]).all() and (counted[0] != counted[1]).any()


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.array([0, 11, 0]), r"actions must be in 0\.\.10, got 0\.\.11"),
        (np.array([0, 0, -1]), r"actions must be in 0\.\.10, got -1\.\.0"),
        (np.zeros(3), r"whole numbers of shape \[3\], got float64 \[3\]"),
        (np.zeros(2, int), r"got int64 \[2\]"),
        (np.zeros((3, 1), int), r"got int64 \[3, 1\]"),
        (np.zeros(3, bool), r"got bool \[3\]"),
        (None, "got object"),
    ],
)
def test_bad_actions_of_a_batch_are_refused(batch, actions, message):
    with pytest.raises(ValueError, match=message) as error:
        batch.step(actions)
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def batch():
    env = vector(3)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("seed", [[1, 2], [1, 2, None], -1, 1.5, "3"])
def test_bad_seeds_of_a_batch_are_refused(batch, seed):
    with pytest.raises(ValueError, match="seed"):
        batch.reset(seed=seed)


def test_bad_options_of_a_batch_are_refused(batch):
    with pytest.raises(ValueError, match="num_envs must be"):
        vector(2.0)
    with pytest.raises(ValueError, match="render_mode must be None or rgb_array"):
        vector(2, render_mode="human")
    with pytest.raises(ValueError, match="autoreset_mode must be NextStep or SameStep, got 'Disabled'"):
        vector(2, autoreset_mode=AutoresetMode.DISABLED)
    with pytest.raises(ValueError, match="autoreset_mode must be"):
        vector(2, autoreset_mode="Sometimes")
    with pytest.raises(ValueError, match="reset_mask"):
        batch.reset(options={"reset_mask": np.array([True, False, False])})
    with pytest.raises(RuntimeError, match=r"call reset\(\) first"):
        vector(2).step(np.zeros(2, int))
