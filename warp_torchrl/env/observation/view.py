"""What an agent sees about itself: its own square of the map, north up."""

from collections.abc import Sequence

from torch import Tensor

from warp_torchrl.env.observation.channels import CHANNELS
from warp_torchrl.env.observation.look import look_at
from warp_torchrl.world.arrays.squares import stacked
from warp_torchrl.world.state.state import Forecast, WorldState
from warp_torchrl.world.world import World


def egocentric_view(
    state: WorldState, world: World, forecast: Forecast, radius: int, channels: Sequence[str]
) -> Tensor:
    """Return the agents' own views in channels by name, uint8 [B, A, C, V, V]."""
    look = look_at(state, world, forecast, radius)
    return stacked([CHANNELS[name].show(look) for name in channels])
