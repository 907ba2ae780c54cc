"""The paper's road: a PettingZoo ParallelEnv through SuperSuit into Stable-Baselines3's PPO (extra `interop`)."""

import argparse

import supersuit
from stable_baselines3 import PPO

from warp_torchrl.api.adapters import parallel_env


def main(steps: int) -> None:
    """Train four bulldozers that share one policy, then let them fight a fire they never saw."""
    env = parallel_env("paper_marl")  # without a seed, each copy has worlds of its own
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    env = supersuit.concat_vec_envs_v1(env, 4, num_cpus=1, base_class="stable_baselines3")
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, device="cpu").learn(steps)

    world = parallel_env("paper_marl", seed=1_000_000)
    observations, infos = world.reset()
    while world.agents:
        actions = {name: int(model.predict(observations[name])[0]) for name in world.agents}
        observations, _, _, _, infos = world.step(actions)
    print(f"{model.num_timesteps} agent steps, {infos['bulldozer_0']['saved']:.1%} of the trees saved")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000, help="agent steps to train for")
    main(parser.parse_args().steps)
