"""A wind that turns when a cold front passes: ``wind=cold_front``."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl import Uniform, WorldState, register
from warp_torchrl.validation import check_fields


@register("wind")
@dataclass(frozen=True, kw_only=True)
class ColdFront(Uniform):
    """One wind over the whole map, which turns once.

    Attributes:
        turn: By how much, degrees counter-clockwise.
        at: The tick after which it has turned.

    Raises:
        ValueError: If a value is out of its range.
    """

    turn: float = -90.0
    at: int = 10

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, turn=(-360.0, 360.0), at=(1, 1_000_000))

    @property
    def changes(self) -> bool:
        """Return True."""
        return True

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the wind of each world after its tick number ``state.tick``, float32 [B, 2, 1, 1] [m/s]."""
        u, v = state.wind.unbind(dim=1)
        cosine, sine = math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))
        turned = torch.stack((cosine * u - sine * v, sine * u + cosine * v), dim=1)
        return torch.where((state.tick == self.at)[:, None, None, None], turned, state.wind)
