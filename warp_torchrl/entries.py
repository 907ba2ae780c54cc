"""Entries of an observation: their change when the map is turned, and their possible content; networks read both.

A square map has eight symmetries: it may be mirrored north to south, east to west, and along its diagonal (the
dihedral group D4). The laws of fire and of the team are the same on all eight. Networks may therefore read each
observation in one canonical orientation (``warp_torchrl.models.canonical``), for which every entry must say what a
symmetry does to it. A checkpoint's manifest keeps what is declared of that.

What a plane can hold follows from the rules of the world, never from what was seen: a team without aircraft has none on
its map, and flat ground shows no heights. Networks leave a plane out of products where it cannot differ. It is no part
of a checkpoint: weights for all planes are kept.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isqrt, prod
from typing import Any, NamedTuple

COMPASS = {
    "north": (-1, 0),
    "north_east": (-1, 1),
    "east": (0, 1),
    "south_east": (1, 1),
    "south": (1, 0),
    "south_west": (1, -1),
    "west": (0, -1),
    "north_west": (-1, -1),
}
"""(row, column) offset of each direction by its name [cells]; rows grow south, columns east."""
LAST = "last_"
"""Prefix of the names of numbers that tell an action of before."""
ADVICE = "advice_"
"""Prefix of the names of numbers that tell an action that an agent is advised to do."""
TEAM_SIZE = "rule_team"
"""Name of the scalar that tells the size of the team, log2(A) / ``LARGEST_TEAM``."""
LARGEST_TEAM = 8
"""log2 of the largest team, which ``TEAM_SIZE`` tells as 1."""
TIME_LEFT = "time_left"
"""Name of the scalar that tells which share of an episode is left; it is 1 at an episode's first step alone."""


class Target(NamedTuple):
    """A channel towards which agents turn: the canonical orientation has it between east and south-east.

    Attributes:
        channel: Its index.
        order: Planes of the lowest order in an observation define the orientation; if they show no target, the next do.
        near: Added to each target's distance, so that all near targets count alike [cells of the plane].
        is_share: Whether targets count by their number; else all numbers over 0 count alike.
        in_middle: Whether the agent is in the middle of the planes; else the observation's part of kind ``place`` has
            its place.
    """

    channel: int
    order: int = 0
    near: float = 2.0
    is_share: bool = False
    in_middle: bool = True


class Planes(NamedTuple):
    """Square maps [C, S, S], or the same flattened [C S S]: each number moves with its cell and does not change.

    Attributes:
        channels: C.
        target: What agents turn towards, if one of the channels shows it.
        is_flat: Whether they are flattened.
    """

    channels: int
    target: Target | None = None
    is_flat: bool = False

    def fits(self, shape: tuple[int, ...]) -> bool:
        """Return whether an entry of one agent can be of this kind."""
        side = isqrt(prod(shape) // self.channels)
        is_square = shape == ((self.channels * side * side,) if self.is_flat else (self.channels, side, side))
        return is_square and (self.target is None or 0 <= self.target.channel < self.channels)


class Part(NamedTuple):
    """Consecutive numbers of a vector.

    Attributes:
        kind: ``scalar``, numbers that do not change; ``place``, row and column as shares 0..1 of the map's height and
            width; ``vector``, components to the east and to the north; ``actions``, one number for each action or
            direction; numbers with a name of ``COMPASS``, alone or after ``LAST`` or ``ADVICE``, change places.
        names: Names of the numbers, in order.
    """

    kind: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Vector:
    """A vector [F] of parts.

    Attributes:
        parts: In order; neighbours of scalars are one part, so that vectors that turn alike are equal.
    """

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        joined: list[Part] = []
        for part in self.parts:
            if joined and part.kind == joined[-1].kind == "scalar":
                joined[-1] = Part("scalar", (*joined[-1].names, *part.names))
            else:
                joined.append(part)
        object.__setattr__(self, "parts", tuple(joined))

    def fits(self, shape: tuple[int, ...]) -> bool:
        """Return whether an entry of one agent can be of this kind."""
        pairs = all(len(part.names) == 2 for part in self.parts if part.kind in ("place", "vector"))
        known = all(part.kind in ("scalar", "place", "vector", "actions") for part in self.parts)
        return pairs and known and shape == (len(self.names),)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all numbers."""
        return tuple(name for part in self.parts for name in part.names)

    def place(self) -> slice | None:
        """Return where the first part of kind ``place`` is; None where there is none."""
        first = 0
        for part in self.parts:
            if part.kind == "place":
                return slice(first, first + 2)
            first += len(part.names)
        return None


class TeamPlanes(NamedTuple):
    """Square maps [C, S, S] of the whole world with the team on them, for a central critic.

    They are turned as an agent in the middle of the team would turn them, and moved so that the box of all targets and
    agents is in the middle. The quarters of the last plane hold one number each: two scalars, and a vector to east and
    north.

    Attributes:
        channels: C.
        target: Channel of the targets, in shares.
        agents: First of the channels with the places of agents, and the number of such channels.
    """

    channels: int
    target: int
    agents: tuple[int, int]

    def fits(self, shape: tuple[int, ...]) -> bool:
        """Return whether a state can be of this kind."""
        known = 0 <= self.target < self.channels - 1 and 0 <= self.agents[0] < sum(self.agents) < self.channels
        return known and len(shape) == 3 and shape[0] == self.channels and shape[1] == shape[2] and shape[1] % 2 == 0


Symmetry = Planes | Vector | TeamPlanes
"""What a symmetry of the map does to an entry."""


def to_plain(symmetry: Symmetry) -> dict[str, Any]:
    """Return a symmetry as a manifest keeps it."""
    if isinstance(symmetry, Vector):
        return {"kind": "Vector", "parts": [part._asdict() for part in symmetry.parts]}
    plain = symmetry._asdict()
    if isinstance(symmetry, Planes) and symmetry.target is not None:
        plain["target"] = symmetry.target._asdict()
    return {"kind": type(symmetry).__name__, **plain}


def from_plain(plain: Mapping[str, Any]) -> Symmetry:
    """Return the symmetry that a manifest keeps.

    Raises:
        ValueError: If it is of no kind that is known.
        TypeError, KeyError: If it has other fields.
    """
    kind = plain["kind"]
    if kind == "Planes":
        target = plain["target"] and Target(**plain["target"])
        return Planes(int(plain["channels"]), target or None, bool(plain["is_flat"]))
    if kind == "Vector":
        return Vector(tuple(Part(str(each["kind"]), tuple(map(str, each["names"]))) for each in plain["parts"]))
    if kind == "TeamPlanes":
        first, count = plain["agents"]
        return TeamPlanes(int(plain["channels"]), int(plain["target"]), (int(first), int(count)))
    raise ValueError(f"kind must be Planes, Vector or TeamPlanes, got {kind!r}")


@dataclass(frozen=True)
class Empty:
    """A plane that is 0 everywhere."""


@dataclass(frozen=True)
class Quarters:
    """A plane that has one number in each of its four quarters."""


@dataclass(frozen=True)
class Follows:
    """A plane that another one tells: offset + factor x that plane, cell by cell.

    Attributes:
        of: Index of the other plane, which may hold anything.
        factor: In the entry's own numbers.
        offset: In the entry's own numbers.
    """

    of: int
    factor: float
    offset: float


Content = Empty | Quarters | Follows | None
"""What a plane can hold; None, anything."""
