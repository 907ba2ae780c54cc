"""Heuristic policies, the baselines. Each is a TensorDictModule.

They read the state through the environment. Where sight is limited they act on what their agents know of the fire, see
``Heuristic.act``; those that teach see every cell.
"""

from warp_torchrl.heuristics.base import idle_action
from warp_torchrl.heuristics.clockwise import Clockwise
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.dispatch import Dispatch
from warp_torchrl.heuristics.following import Follower
from warp_torchrl.heuristics.heuristic import Heuristic, Worlds
from warp_torchrl.heuristics.own_land import OwnLand
from warp_torchrl.heuristics.reactive import Greedy, Local, NoOp, Random
from warp_torchrl.heuristics.ring import Mixed, Ring
from warp_torchrl.heuristics.rollout import Rollout
from warp_torchrl.heuristics.searching import Lawnmower, Oldest, Searching
from warp_torchrl.heuristics.targeting import Targeted

HEURISTICS: dict[str, type[Heuristic]] = {
    "noop": NoOp,
    "random": Random,
    "local": Local,
    "greedy": Greedy,
    "coordinated": Coordinated,
    "dispatch": Dispatch,
    "ring": Ring,
    "mixed": Mixed,
    "oldest": Oldest,
    "lawnmower": Lawnmower,
    "follower": Follower,
    "targeted": Targeted,
    "clockwise": Clockwise,
    "own_land": OwnLand,
    "rollout": Rollout,
}
"""Heuristic policies by name."""
TEACHERS = tuple(name for name, heuristic in HEURISTICS.items() if not heuristic.is_stateful)
"""Those whose action depends on the state alone: they can teach, guide and advise."""

__all__ = [
    "HEURISTICS",
    "TEACHERS",
    "Clockwise",
    "Coordinated",
    "Dispatch",
    "Follower",
    "Greedy",
    "Heuristic",
    "Lawnmower",
    "Local",
    "Mixed",
    "NoOp",
    "Oldest",
    "OwnLand",
    "Random",
    "Ring",
    "Rollout",
    "Searching",
    "Targeted",
    "Worlds",
    "idle_action",
]
