"""What the planes of an entry can hold in a world: an observation declares it, and networks leave the rest out.

A team without aircraft has none on its map, and flat ground shows no heights. What a plane can hold follows from the
rules of the world, never from what was seen, so that a plane is left out of products where it cannot differ, and read
where it can. It is no part of a checkpoint: weights for all planes are kept.
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
