"""Where vehicles find water: the map of it, which ``Team`` reads about each vehicle alone."""

from torch import Tensor

from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.state.state import Cover, WorldState


def mark_base(state: WorldState, mask: Tensor) -> Tensor:
    """Return marked cells, bool [B, H, W], with the base of each world among them."""
    base = state.vehicles.base[:, 0] * mask.shape[2] + state.vehicles.base[:, 1]
    return mask.flatten(1).scatter(1, base[:, None], True).view_as(mask)


def where_tanks_fill(state: WorldState) -> Tensor:
    """Return the cells where a tank fills, bool [B, H, W]: lakes, those beside one, and the base."""
    return mark_base(state, grow(state.cover == int(Cover.LAKE)))
