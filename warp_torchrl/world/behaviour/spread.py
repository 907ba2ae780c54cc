"""Common result of all models of fire spread: the fire's head."""

from collections.abc import Callable
from dataclasses import dataclass, fields

from torch import Tensor


@dataclass(frozen=True)
class Spread:
    """The head of a fire that spreads freely; all fields float32 of one shape."""

    head: Tensor  # rate of spread of the head [m/min]
    direction: Tensor  # where the head goes, degrees clockwise from grid north, 0..360
    length_to_breadth: Tensor  # of the ellipse that the fire grows into, 1 or more
    intensity: Tensor  # fireline intensity at the head (Byram 1959) [kW/m]
    flame_length: Tensor  # at the head [m]
    kind: Tensor  # of fire at the head: 0 surface, 1 passive crown fire, 2 active crown fire

    def each(self, change: Callable[[Tensor], Tensor]) -> "Spread":
        """Return the same with every field changed."""
        return Spread(**{field.name: change(getattr(self, field.name)) for field in fields(self)})
