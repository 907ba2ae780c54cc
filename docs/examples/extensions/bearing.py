"""An observation with one more entry, the way to the fire: ``observation=bearing``."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl import WorldState, register
from warp_torchrl.entries import Part, Vector
from warp_torchrl.env.observation.presets import Local, Space
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Forecast
from warp_torchrl.world.world import World


@register("observation")
@dataclass(frozen=True, kw_only=True)
class Bearing(Local):
    """As ``Local``, with ``bearing``: the mean offset to what burns, to east and north, as shares of the map."""

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        turns = Vector((Part("vector", ("fire_east", "fire_north")),))
        return {**super().spaces(world), "bearing": Space((2,), torch.float32, -1.0, 1.0, symmetry=turns)}

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``view``, ``status``, and ``bearing`` float32 [B, A, 2], 0 where nothing burns."""
        burning = is_burning(state.cells).to(torch.float32)
        count, means = burning.sum((1, 2)), []
        for sums in (burning.sum(2), burning.sum(1)):  # of rows, of columns
            along = torch.arange(sums.shape[1], device=sums.device, dtype=torch.float32)
            means.append((sums * along).sum(1) / count.clamp(min=1.0))
        away = (torch.stack(means, dim=-1)[:, None] - state.vehicles.position) * (count > 0)[:, None, None]
        down, right = away.unbind(-1)
        height, width = state.cells.shape[1:]
        return {**super().__call__(state, world, forecast), "bearing": torch.stack((right / width, -down / height), -1)}
