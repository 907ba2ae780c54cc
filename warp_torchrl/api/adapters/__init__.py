"""Adapters: PettingZoo and Gymnasium interfaces of a ``WildfireEnv``."""

from warp_torchrl.api.adapters.gymnasium import FireExtinguishingEnv, gym_env
from warp_torchrl.api.adapters.pettingzoo import FireExtinguishingEnvParallel, parallel_env
from warp_torchrl.api.adapters.vector import FireExtinguishingVectorEnv

__all__ = [
    "FireExtinguishingEnv",
    "FireExtinguishingEnvParallel",
    "FireExtinguishingVectorEnv",
    "gym_env",
    "parallel_env",
]
