"""Teams of autonomous vehicles that learn to fight wildfires, as a TorchRL environment."""

import os

# Waiting OpenMP threads spin by default: beside any other load on the machine a step of small tensors then takes up
# to thirty times as long. It is read when torch is first imported; whoever has set it keeps their setting.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

from warp_torchrl.api import load_policy, make_env, simulate
from warp_torchrl.env import WildfireEnv

__version__ = "0.1.0"
__all__ = ["WildfireEnv", "__version__", "load_policy", "make_env", "simulate"]
