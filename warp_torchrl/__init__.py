"""Teams of autonomous vehicles that learn to fight wildfires, as a TorchRL environment."""

from warp_torchrl.api import load_policy, make_env, simulate
from warp_torchrl.env import WildfireEnv

__version__ = "0.1.0"
__all__ = ["WildfireEnv", "__version__", "load_policy", "make_env", "simulate"]
