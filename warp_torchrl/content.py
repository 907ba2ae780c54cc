"""Content of the planes of an entry: numbers that they cannot hold in a world, declared by an observation.

A team without aircraft has none on its map, and flat ground shows no heights. The content of a plane follows from the
rules of the world, never from observations, so networks skip a plane if it cannot vary, and read it if it can.
Checkpoints do not store contents: they keep weights for all planes.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Empty:
    """A plane that is 0 everywhere."""


@dataclass(frozen=True)
class Quarters:
    """A plane that has one number in each of its four quarters."""


@dataclass(frozen=True)
class Follows:
    """A plane that is a linear function of another, cell by cell: offset + factor x that plane.

    Attributes:
        of: Index of the other plane, which may hold anything.
        factor: In the entry's numbers.
        offset: In the entry's numbers.
    """

    of: int
    factor: float
    offset: float


Content = Empty | Quarters | Follows | None
"""What a plane can hold; None, anything."""
