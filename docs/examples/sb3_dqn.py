"""Stable-Baselines3's DQN on the Gymnasium environment of one bulldozer (extra `interop`)."""

import argparse

import gymnasium
from stable_baselines3 import DQN

import warp_torchrl  # noqa: F401  registers Wildfire-v0


def main(steps: int) -> None:
    """Train one bulldozer, then let it fight a fire it never saw."""
    env = gymnasium.make("Wildfire-v0", scenario="paper_sarl")
    model = DQN("MlpPolicy", env, buffer_size=50_000, learning_starts=min(1000, steps // 2), device="cpu").learn(steps)

    observation, info = env.reset(seed=1_000_000)
    ended = False
    while not ended:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    print(f"{model.num_timesteps} steps, {info['saved']:.1%} of the trees saved")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=50_000, help="steps to train for")
    main(parser.parse_args().steps)
