"""Tianshou's DQN on a team that takes turns, one learner for each bulldozer."""

import argparse

from tianshou.algorithm import DQN, MultiAgentOffPolicyAlgorithm
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, PettingZooEnv
from tianshou.trainer import OffPolicyTrainerParams
from tianshou.utils.net.common import Net

from warp_torchrl.api.adapters import pettingzoo


def make():
    """Make a team whose mask Tianshou finds; without a seed, each copy has fires of its own."""
    return PettingZooEnv(pettingzoo.env("skirmish", layout="flat"))


def learner(env):
    """Make the DQN of one agent."""
    seen = env.observation_space["observation"]
    model = Net(state_shape=seen.shape, action_shape=int(env.action_space.n), hidden_sizes=[64, 64])
    policy = DiscreteQLearningPolicy(
        model=model, action_space=env.action_space, observation_space=seen, eps_training=0.1
    )
    return DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3), gamma=0.98, target_update_freq=100)


def main(steps: int) -> None:
    """Train two bulldozers."""
    env, worlds = make(), DummyVectorEnv([make] * 4)
    team = MultiAgentOffPolicyAlgorithm(algorithms=[learner(env) for _ in env.agents], env=env)
    collector = Collector(team, worlds, VectorReplayBuffer(20_000, buffer_num=4), exploration_noise=True)
    collector.reset()
    team.run_training(
        OffPolicyTrainerParams(
            training_collector=collector,
            max_epochs=1,
            epoch_num_steps=steps,
            collection_step_num_env_steps=min(steps, 64),
            update_step_num_gradient_steps_per_sample=0.1,
            verbose=False,
            show_progress=False,
            test_in_training=False,
        )
    )
    print(f"{collector.collect_step} turns")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=20_000, help="turns to train for")
    main(parser.parse_args().steps)
