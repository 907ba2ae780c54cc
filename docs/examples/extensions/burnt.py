"""What has burned: a number of status, a channel of the picture and a plane of the critic's state.

``observation=burnt`` shows all three.
"""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl import Surroundings, register
from warp_torchrl.env.observation.coarse_picture import Blocks
from warp_torchrl.env.observation.critic import STATE_SIDE
from warp_torchrl.env.observation.features import Context
from warp_torchrl.world.arrays.blocks import block_means


@register("number")
def burnt_share(now: Context) -> Tensor:
    """Return the share of the map that has burned."""
    share = block_means(now.state.burned, 1)[:, 0]
    return share.expand(now.state.vehicles.tank.shape)


@register("picture_channel")
def burnt_nearby(now: Blocks) -> Tensor:
    """Return the share of each block that has burned."""
    return now.show(block_means(now.state.burned, now.side))


@register("state_plane")
def burnt(now: Context) -> Tensor:
    """Return the share of each block that has burned."""
    return block_means(now.state.burned, STATE_SIDE)


@register("observation")
@dataclass(frozen=True, kw_only=True)
class Burnt(Surroundings):
    """As ``Surroundings``, with what has burned."""

    features: tuple[str, ...] = ("burnt_share", "burnt_nearby", "burnt")
