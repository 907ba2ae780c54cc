"""A law of fire, in which a tree ignites where several neighbours burn: ``fire=threshold``."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl import Fire, WorldState, register
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import neighbour_in


@register("fire")
@dataclass(frozen=True, kw_only=True)
class Threshold(Fire):
    """A tree ignites with one probability where enough of its neighbours burn.

    Bootstrap percolation (Chalupa, Leath and Reich 1979); wind and slope play no part.

    Attributes:
        least: Burning neighbours that it takes.
        probability: In one tick.

    Raises:
        ValueError: If a value is out of its range.
    """

    least: int = 2
    probability: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, least=(1, 8), probability=(0.0, 1.0))

    def spread_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to be ignited by its neighbours in one tick, float32 [B, H, W]."""
        burns = self.spreads(state).to(torch.float32)
        around = torch.stack([neighbour_in(direction, burns) for direction in self.directions]).sum(0)
        return self.probability * ((around >= self.least) & self.is_fuel(state))

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many trees beside each burning cell are expected to ignite in one tick, float32 [B, H, W]."""
        chance = self.spread_probability(state)
        beside = torch.stack([neighbour_in(direction, chance) for direction in self.directions]).sum(0)
        return beside * self.spreads(state)
