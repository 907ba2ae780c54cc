"""Teams of autonomous vehicles that learn to fight wildfires, as a TorchRL environment."""

import gymnasium

import warp_torchrl.process  # noqa: F401, before torch is imported
from warp_torchrl.api import load_policy, make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.simulation import fire_history, simulate

gymnasium.register(
    "Wildfire-v0",
    entry_point="warp_torchrl.adapters:FireExtinguishingEnv",
    vector_entry_point="warp_torchrl.adapters:FireExtinguishingVectorEnv",
)

__version__ = "0.1.0"
__all__ = ["WildfireEnv", "__version__", "fire_history", "load_policy", "make_env", "simulate"]
