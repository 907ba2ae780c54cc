"""Policies without learning, the baselines. Each is usable wherever a policy is: tensordict in, action out.

They read the worlds through the environment: all but ``local`` see every cell, which no learned policy does.
"""

from warp_torchrl.heuristics.base import Heuristic, idle_action
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.reactive import Greedy, Local, NoOp, Random
from warp_torchrl.heuristics.ring import Mixed, Ring

HEURISTICS: dict[str, type[Heuristic]] = {
    "noop": NoOp,
    "random": Random,
    "local": Local,
    "greedy": Greedy,
    "coordinated": Coordinated,
    "ring": Ring,
    "mixed": Mixed,
}
"""Policies by name."""

__all__ = [
    "HEURISTICS",
    "Coordinated",
    "Greedy",
    "Heuristic",
    "Local",
    "Mixed",
    "NoOp",
    "Random",
    "Ring",
    "idle_action",
]
