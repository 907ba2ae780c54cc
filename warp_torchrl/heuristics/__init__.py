"""Heuristic policies, the baselines. Each is a TensorDictModule.

They read the state through the environment. Where sight is limited they act on what their agents know of the fire, see
``Heuristic.act``; those that teach see every cell.
"""

from collections.abc import Callable

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
from warp_torchrl.heuristics.switching import Switching
from warp_torchrl.heuristics.tactics import AnchorAndFlank, FlankAttack, HeadAttack, PointProtection
from warp_torchrl.heuristics.targeting import Targeted
from warp_torchrl.validation import check_new_name

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
    "head_attack": HeadAttack,
    "flank_attack": FlankAttack,
    "anchor_and_flank": AnchorAndFlank,
    "point_protection": PointProtection,
    "rollout": Rollout,
    "switching": Switching,
}
"""Heuristic policies by name; ``heuristic`` adds to them."""
TEACHERS = {name: kind for name, kind in HEURISTICS.items() if not kind.is_stateful}
"""Those whose action depends on the state alone: they can teach, guide and advise."""


def heuristic(name: str) -> Callable[[type[Heuristic]], type[Heuristic]]:
    """Return what adds a heuristic to the table under a name.

    Raises:
        ValueError: If it is no ``Heuristic``, or the table has another module's heuristic of that name.
    """

    def add(kind: type[Heuristic]) -> type[Heuristic]:
        if not (isinstance(kind, type) and issubclass(kind, Heuristic)):
            raise ValueError(f"{name} must be a class that extends Heuristic, got {kind!r}")
        check_new_name("heuristic", name, kind, HEURISTICS.get(name))
        HEURISTICS[name] = kind
        if not kind.is_stateful:
            TEACHERS[name] = kind
        return kind

    return add


__all__ = [
    "HEURISTICS",
    "TEACHERS",
    "AnchorAndFlank",
    "Clockwise",
    "Coordinated",
    "Dispatch",
    "FlankAttack",
    "Follower",
    "Greedy",
    "HeadAttack",
    "Heuristic",
    "Lawnmower",
    "Local",
    "Mixed",
    "NoOp",
    "Oldest",
    "OwnLand",
    "PointProtection",
    "Random",
    "Ring",
    "Rollout",
    "Searching",
    "Switching",
    "Targeted",
    "Worlds",
    "heuristic",
    "idle_action",
]
