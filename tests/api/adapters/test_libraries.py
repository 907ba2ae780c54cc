"""Other libraries on the views."""

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import flatten, flatten_space
from torchrl.envs import GymEnv, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

from warp_torchrl.api.adapters import gym_env, parallel_env, pettingzoo

TINY_PPO = {"n_steps": 16, "batch_size": 16, "n_epochs": 1, "device": "cpu"}


@pytest.mark.parametrize("options", [{}, {"observation": "paper", "frame_skip": 2}, {"from_pixels": True}])
def test_torchrl_makes_it_by_name(options):
    env = GymEnv("Wildfire-v0", horizon=4, **options)
    check_env_specs(env)
    assert env.rollout(6)["next", "done"].any()


@pytest.mark.parametrize("layout", ["dict", "flat"])
@pytest.mark.parametrize(("scenario", "observation"), [("hetero", "surroundings"), ("skirmish", "paper")])
def test_torchrl_reads_it_back(scenario, observation, layout):
    env = PettingZooWrapper(
        parallel_env(scenario, horizon=4, observation=observation, layout=layout), return_state=True
    )
    check_env_specs(env)
    rollout = env.rollout(6, break_when_any_done=False)
    assert rollout["next", "done"].sum() == 1 and rollout["next", "state"].shape == (6, 8, 16, 16)
    assert rollout["bulldozer", "action_mask"].shape[-1] == 11 and (rollout["bulldozer", "info", "saved"] > 0).all()


def test_supersuit_and_stable_baselines3_train_a_team():
    supersuit = pytest.importorskip("supersuit")
    sb3 = pytest.importorskip("stable_baselines3")
    env = supersuit.pad_action_space_v0(supersuit.pad_observations_v0(parallel_env("paper_marl")))
    env = supersuit.frame_stack_v1(supersuit.flatten_v0(env), 2)
    worlds = supersuit.concat_vec_envs_v1(
        supersuit.pettingzoo_env_to_vec_env_v1(env), 2, num_cpus=1, base_class="stable_baselines3"
    )
    learner = sb3.PPO("MlpPolicy", worlds, **TINY_PPO).learn(128)
    actions, _ = learner.predict(worlds.reset())
    assert learner.num_timesteps >= 128 and actions.shape == (2 * env.max_num_agents,)


def test_supersuit_s_copies_differ():
    supersuit = pytest.importorskip("supersuit")
    worlds = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(parallel_env("paper_marl")), 3)
    n_agents = worlds.num_envs // 3
    seen = worlds.reset()[0].reshape(3, n_agents, -1)
    assert (seen[0] != seen[1]).any() and (seen[0] != seen[2]).any() and (seen[1] != seen[2]).any()


@pytest.mark.parametrize("frames", [2, (2, 3)])
def test_supersuit_skips_frames(frames):
    supersuit = pytest.importorskip("supersuit")
    one, team = supersuit.frame_skip_v0(gym_env(), frames), supersuit.frame_skip_v0(parallel_env("skirmish"), frames)
    one.reset(seed=0), team.reset(seed=0)
    assert one.step(8)[4]["episode_length"] >= 2
    infos = team.step(dict.fromkeys(team.agents, 8))[4]
    assert infos["bulldozer_0"]["episode_length"] >= 2


@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_tianshou_finds_the_mask_beside_the_observation(observation):
    env = AsTianshouReads(pettingzoo.env("hetero", horizon=2, observation=observation, layout="flat"))
    seen, _ = env.reset(seed=0)
    for _ in range(6):
        assert seen["obs"] in env.observation_space["observation"] and seen["obs"].ndim == 1
        assert len(seen["mask"]) == env.action_space.n and seen["mask"][10]
        seen, *_ = env.step(int(np.flatnonzero(seen["mask"])[0]))


class AsTianshouReads:
    """What ``tianshou.env.PettingZooEnv`` of Tianshou 2.0.1 asks of an AECEnv, and makes of its observations."""

    def __init__(self, env):
        self.env = env
        first = env.possible_agents[0]
        self.observation_space, self.action_space = env.observation_space(first), env.action_space(first)
        assert all(env.observation_space(agent) == self.observation_space for agent in env.possible_agents)
        assert all(env.action_space(agent) == self.action_space for agent in env.possible_agents)

    def reset(self, seed):
        self.env.reset(seed=seed)
        observation, *_, info = self.env.last(self)
        return self.read(observation), info

    def step(self, action):
        self.env.step(action)
        observation, *rest = self.env.last()
        return self.read(observation), *rest

    def read(self, observation):
        assert isinstance(observation, dict) and "action_mask" in observation
        mask = [each == 1 for each in observation["action_mask"]]
        return {"agent_id": self.env.agent_selection, "obs": observation["observation"], "mask": mask}


def test_supersuit_flattens_a_dict():
    supersuit = pytest.importorskip("supersuit")
    env = supersuit.observation_lambda_v0(
        parallel_env("hetero", horizon=4), lambda seen, space: flatten(space, seen), flatten_space
    )
    seen, _ = env.reset()
    assert all(seen[name] in env.observation_space(name) and seen[name].ndim == 1 for name in seen)


@pytest.mark.filterwarnings("ignore:.*image", "ignore:.*spaces")
@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_stable_baselines3_finds_its_interface_kept(observation):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_checker import check_env

    check_env(gym_env(horizon=12, observation=observation))


def test_stable_baselines3_trains_one_agent():
    sb3 = pytest.importorskip("stable_baselines3")
    env = gymnasium.wrappers.FlattenObservation(gymnasium.make("Wildfire-v0", horizon=20))
    assert sb3.DQN("MlpPolicy", env, learning_starts=10, buffer_size=100, device="cpu").learn(20).num_timesteps == 20
    learner = sb3.PPO("MultiInputPolicy", "Wildfire-v0", **TINY_PPO).learn(16)
    assert learner.num_timesteps == 16


@pytest.mark.parametrize("centred", ["false", "true"])
def test_stable_baselines3_takes_nothing_for_a_photograph(centred):
    """Its network for photographs needs 36 x 36 pixels."""
    preprocessing = pytest.importorskip("stable_baselines3.common.preprocessing")
    space = gym_env(overrides=["observation=surroundings", f"observation.centred={centred}"]).observation_space
    assert not any(preprocessing.is_image_space(each) for each in space.values())


@pytest.mark.parametrize("policy", ["MultiInputPolicy", "MlpPolicy"])
def test_stable_baselines3_contrib_masks_actions(policy):
    contrib = pytest.importorskip("sb3_contrib")
    env = gymnasium.make("Wildfire-v0", horizon=20)
    env = env if policy == "MultiInputPolicy" else gymnasium.wrappers.FlattenObservation(env)
    learner = contrib.MaskablePPO(policy, env, **TINY_PPO).learn(16)
    seen, _ = env.reset(seed=0)
    action, _ = learner.predict(seen, action_masks=env.unwrapped.action_masks())
    assert env.unwrapped.action_masks()[action]
