"""Where vehicles are: in which wind."""

from torch import Tensor

from warp_torchrl.world.state.state import WorldState


def wind_at(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, float32 [B, A, 2], (u east, v north) [m/s]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        return wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    index = position[..., 0] * wind.shape[3] + position[..., 1]
    return wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
