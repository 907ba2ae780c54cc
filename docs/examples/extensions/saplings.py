"""A channel of the view that shows trees too young to burn: ``observation=saplings``."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl import Look, Surroundings, register
from warp_torchrl.env.observation.channels import DEFAULT


@register("channel", high=255)
def sapling(look: Look) -> Tensor:
    """Return 255 where a tree is too young to ignite."""
    return ((look.cells >= 1) & (look.cells < look.world.fire.youngest_fuel)) * 255


@register("observation")
@dataclass(frozen=True, kw_only=True)
class Saplings(Surroundings):
    """As ``Surroundings``, with the channel ``sapling`` at the end of the view."""

    channels: tuple[str, ...] = (*DEFAULT, "sapling")
