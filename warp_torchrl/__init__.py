"""Teams of autonomous vehicles that learn to fight wildfires, as a TorchRL environment."""

import os

from warp_torchrl.system.interruption import end_on_signal, is_command
from warp_torchrl.system.parent import end_with_binder

if is_command():  # the imports below take seconds
    end_on_signal()
else:
    end_with_binder()

# GNU OpenMP's waiting threads spin for milliseconds by default. On a busy machine a step of small tensors then took 30
# times as long; a short spin avoids this and costs almost nothing on an idle one. torch reads the variable when it is
# first imported; a value set by the user stays.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")

from typing import Any

import gymnasium
import pettingzoo

from warp_torchrl.api.make import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.prediction.simulation import fire_history, simulate
from warp_torchrl.runs.policies.load import load_policy
from warp_torchrl.world.behaviour.rate_of_spread import rate_of_spread

gymnasium.register(
    "Wildfire-v0",
    entry_point="warp_torchrl.api.adapters:FireExtinguishingEnv",
    vector_entry_point="warp_torchrl.api.adapters:FireExtinguishingVectorEnv",
)
if hasattr(pettingzoo, "register"):  # older ones have no registry
    pettingzoo.register("parallel", "Wildfire-v0", entry_point="warp_torchrl.api.adapters:parallel_env")
    pettingzoo.register("aec", "Wildfire-v0", entry_point="warp_torchrl.api.adapters.pettingzoo:env")

__version__ = "0.1.0"
__all__ = ["WildfireEnv", "__version__", "fire_history", "load_policy", "make_env", "rate_of_spread", "simulate"]


def __getattr__(name: str) -> Any:
    """Return what is imported when it is first asked for."""
    if name == "predict":
        from warp_torchrl.prediction.predict import predict

        return predict
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
