"""Showers that wet trees."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import WorldState


@dataclass(eq=False, repr=False)
class Sky(Batch):
    """Where it rains."""

    rain: Tensor  # uint8 [B,H,W], 255 where it rained in the last step, else 0
    rained: Tensor  # float32 [B], sum over steps of the share of the map where it rained


@mechanic("showers")
@dataclass(frozen=True, kw_only=True)
class Showers(Mechanic):
    """Showers, at most one a step, each over a square of the map; trees that they wet cannot ignite for some ticks.

    Attributes:
        chance: That a shower falls in a step.
        radius: Of the square about a cell, which is drawn [cells].
        wet: For how long trees stay wet [ticks].

    Raises:
        ValueError: If a value is out of its range.
    """

    chance: float = 0.1
    radius: int = 3
    wet: int = 2

    maps: ClassVar = {"rain": lambda state: state.planes("showers", Sky).rain}

    def __post_init__(self) -> None:
        check_fields(self, chance=(0.0, 1.0), radius=(0, 64), wet=(1, 255))

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds under a clear sky."""
        return state.with_planes(self.name, Sky(torch.zeros_like(state.cells), torch.zeros_like(state.burning_area)))

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step, in which a shower may have fallen."""
        sky, (height, width) = after.planes(self.name, Sky), after.cells.shape[1:]
        fall, down, across = uniform(named_key(after.key, self.name), before.step, Stream.WEATHER, (3,)).unbind(1)
        rows = (torch.arange(height, device=fall.device) - (down * height).floor()[:, None]).abs() <= self.radius
        columns = (torch.arange(width, device=fall.device) - (across * width).floor()[:, None]).abs() <= self.radius
        falls = (running & (fall < self.chance))[:, None, None] & rows[:, :, None] & columns[:, None]
        wet = torch.where(falls & is_tree(after.cells), after.wet.clamp(min=self.wet), after.wet)
        rain = torch.where(running[:, None, None], falls.to(torch.uint8) * 255, sky.rain)
        rained = sky.rained + falls.to(torch.float32).mean((1, 2))
        return after.replace(wet=wet).with_planes(self.name, Sky(rain, rained))

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``rained``."""
        return (Metric("rained"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``rained``, the share of the map where it rained, mean over the steps."""
        return {"rained": state.planes(self.name, Sky).rained / state.step.clamp(min=1)}
