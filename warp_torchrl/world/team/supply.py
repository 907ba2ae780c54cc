"""Water: the cells where vehicles fill their tanks, and the filling."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.abilities import AgentContext, neighbourhood


def mark_base(state: WorldState, mask: Tensor) -> Tensor:
    """Return marked cells, bool [B, H, W], with the base of each world among them."""
    base = state.vehicles.base[:, 0] * mask.shape[2] + state.vehicles.base[:, 1]
    return mask.flatten(1).scatter(1, base[:, None], True).view_as(mask)


def where_tanks_fill(state: WorldState) -> Tensor:
    """Return the cells where a tank fills, bool [B, H, W]: lakes, those beside one, and the base."""
    return mark_base(state, grow(state.cover == int(Cover.LAKE)))


def filled(state: WorldState, tank: Tensor, full: int) -> Tensor:
    """Return the tanks, int32 [B, A], with those of vehicles in a cell of ``where_tanks_fill`` full.

    Only the cells about the vehicles are read, not the map.
    """
    index, inside = neighbourhood(state)
    cover = AgentContext.at(state.cover, index.flatten(1)).view_as(index)
    by_lake = ((cover == int(Cover.LAKE)) & inside).any(dim=-1)
    at_base = (state.vehicles.position == state.vehicles.base[:, None]).all(dim=-1)
    return torch.where(by_lake | at_base, full, tank)
