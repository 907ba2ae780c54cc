"""The environment in other tools' clothes: PettingZoo and Gymnasium views of one ``WildfireEnv``, without physics."""

from warp_torchrl.adapters.gymnasium import FireExtinguishingEnv, FireExtinguishingVectorEnv, gym_env
from warp_torchrl.adapters.pettingzoo import FireExtinguishingEnvParallel, parallel_env

__all__ = [
    "FireExtinguishingEnv",
    "FireExtinguishingEnvParallel",
    "FireExtinguishingVectorEnv",
    "gym_env",
    "parallel_env",
]
