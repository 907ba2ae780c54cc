"""Teams of autonomous vehicles that learn to fight wildfires, as a TorchRL environment."""

import os

from warp_torchrl.system.interruption import end_on_signal, is_command, watch_end
from warp_torchrl.system.parent import end_with_binder, is_child

if is_command() or is_child():
    watch_end()
if is_command():  # the imports below take seconds
    end_on_signal()
else:
    end_with_binder()

# GNU OpenMP's waiting threads spin for milliseconds by default. On a busy machine a step of small tensors then took 30
# times as long; a short spin avoids this and costs almost nothing on an idle one. torch reads the variable when it is
# first imported; a value set by the user stays.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_torchrl.algorithms.off_policy import OffPolicy
    from warp_torchrl.algorithms.on_policy import OnPolicy
    from warp_torchrl.algorithms.ppo import Ppo
    from warp_torchrl.api.evaluate import evaluate
    from warp_torchrl.api.make import make_env
    from warp_torchrl.api.names import baselines, scenarios
    from warp_torchrl.api.train import train
    from warp_torchrl.env import WildfireEnv
    from warp_torchrl.env.observation import Look, Surroundings
    from warp_torchrl.env.reward import Reward
    from warp_torchrl.heuristics import Heuristic
    from warp_torchrl.models import Mlp
    from warp_torchrl.prediction.predict import predict
    from warp_torchrl.prediction.simulation import fire_history, simulate
    from warp_torchrl.runs.config.registration import add_scenario, register
    from warp_torchrl.runs.policies.load import load_policy
    from warp_torchrl.world.air.wind import Uniform
    from warp_torchrl.world.behaviour.rate_of_spread import rate_of_spread
    from warp_torchrl.world.law.fire import Fire
    from warp_torchrl.world.mechanics.mechanic import Mechanic
    from warp_torchrl.world.state.state import Transition, WorldState
    from warp_torchrl.world.terrain.array import Array


def register_environments() -> None:
    """Let Gymnasium and PettingZoo make our environments by name."""
    import gymnasium
    import pettingzoo

    gymnasium.register(
        "Wildfire-v0",
        entry_point="warp_torchrl.api.adapters:FireExtinguishingEnv",
        vector_entry_point="warp_torchrl.api.adapters:FireExtinguishingVectorEnv",
    )
    if hasattr(pettingzoo, "register"):  # older ones have no registry
        pettingzoo.register("parallel", "Wildfire-v0", entry_point="warp_torchrl.api.adapters:parallel_env")
        pettingzoo.register("aec", "Wildfire-v0", entry_point="warp_torchrl.api.adapters.pettingzoo:env")


if not is_command():  # which does so after its first look
    register_environments()

__version__ = "0.1.0"
_PLACES = {
    "Array": "world.terrain.array",
    "Fire": "world.law.fire",
    "Heuristic": "heuristics",
    "Look": "env.observation",
    "Mechanic": "world.mechanics.mechanic",
    "Mlp": "models",
    "OffPolicy": "algorithms.off_policy",
    "OnPolicy": "algorithms.on_policy",
    "Ppo": "algorithms.ppo",
    "Reward": "env.reward",
    "Surroundings": "env.observation",
    "Transition": "world.state.state",
    "Uniform": "world.air.wind",
    "WildfireEnv": "env",
    "WorldState": "world.state.state",
    "add_scenario": "runs.config.registration",
    "baselines": "api.names",
    "evaluate": "api.evaluate",
    "fire_history": "prediction.simulation",
    "load_policy": "runs.policies.load",
    "make_env": "api.make",
    "predict": "prediction.predict",
    "rate_of_spread": "world.behaviour.rate_of_spread",
    "register": "runs.config.registration",
    "scenarios": "api.names",
    "simulate": "prediction.simulation",
    "train": "api.train",
}
__all__ = [
    "Array",
    "Fire",
    "Heuristic",
    "Look",
    "Mechanic",
    "Mlp",
    "OffPolicy",
    "OnPolicy",
    "Ppo",
    "Reward",
    "Surroundings",
    "Transition",
    "Uniform",
    "WildfireEnv",
    "WorldState",
    "__version__",
    "add_scenario",
    "baselines",
    "evaluate",
    "fire_history",
    "load_policy",
    "make_env",
    "predict",
    "rate_of_spread",
    "register",
    "scenarios",
    "simulate",
    "train",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: torch and TorchRL take seconds."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    return found


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)
