"""Frame stacking with SuperSuit on the PettingZoo view, and Stable-Baselines3's PPO on top (extra `interop`)."""

import argparse

import supersuit
from stable_baselines3 import PPO

from warp_torchrl.api.adapters import parallel_env


def main(steps: int) -> None:
    """Train on each agent's last four observations."""
    env = parallel_env("paper_marl")
    size = env.observation_space("bulldozer_0").shape[0]
    env = supersuit.frame_stack_v1(env, 4)  # stacks a Box, which preset `paper` is
    stacked = env.observation_space("bulldozer_0").shape[0]
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    env = supersuit.concat_vec_envs_v1(env, 4, num_cpus=1, base_class="stable_baselines3")
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, device="cpu").learn(steps)
    print(f"{size} numbers became {stacked}; {model.num_timesteps} agent steps")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000, help="agent steps to train for")
    main(parser.parse_args().steps)
