"""What agents may be shown: a preset is a component.

Its ``spaces`` tell the environment the shape, type and range of each entry, and called with a state it returns them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.observation.channels import CHANNELS, DEFAULT, ages, check_channels, stages
from warp_torchrl.observation.coarse import CENTRED_HIGHS, PICTURE, PICTURE_SIDE, centred_picture, picture
from warp_torchrl.observation.own import own_names, own_vector
from warp_torchrl.observation.view import egocentric_view
from warp_torchrl.validation import check_fields
from warp_torchrl.world.fast.squares import window
from warp_torchrl.world.state import Forecast, WorldState
from warp_torchrl.world.world import World


class Space(NamedTuple):
    """Shape (one agent's), type and range of an entry of an observation."""

    shape: tuple[int, ...]
    dtype: torch.dtype
    low: float
    high: float | tuple[float, ...]  # of all numbers, or one for each channel
    names: tuple[str, ...] = ()  # of the channels of a map or the entries of a vector, where they have any

    def bounds(self) -> tuple[Tensor, Tensor]:
        """Return the least and the largest value of each number, both of the entry's shape and type."""
        low, high = torch.full(self.shape, self.low, dtype=self.dtype), torch.tensor(self.high, dtype=self.dtype)
        per_channel = high.view(-1, *[1] * (len(self.shape) - 1)) if high.ndim else high
        return low, per_channel.expand(self.shape).contiguous()


@dataclass(frozen=True, kw_only=True)
class Local:
    """What an agent sees of its own surroundings, and nothing else.

    ``view`` is the square of 2 r + 1 cells about the agent, north up, uint8, in channels that are chosen by name from
    ``observation.channels.CHANNELS``. ``self`` is what it knows of itself, see ``own_names``.

    Attributes:
        radius: r [cells].
        identity: Whether ``self`` ends with the agent's place in its team, see ``identity``: agents that stand together
            and see the same can then part.
        channels: Names of the view's channels, in order.

    Raises:
        ValueError: If the radius is not in 1..32, or a channel is unknown.
    """

    radius: int = 5
    identity: bool = False
    channels: tuple[str, ...] = DEFAULT

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))
        check_channels(self.channels)

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        side, highs = 2 * self.radius + 1, tuple(CHANNELS[name].high for name in self.channels)
        own = own_names(world.team, self.identity)
        return {
            "view": Space((len(highs), side, side), torch.uint8, 0, highs, self.channels),
            "self": Space((len(own),), torch.float32, -3.0, 3.0, own),
        }

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``view`` uint8 [B, A, C, V, V] and ``self`` float32 [B, A, F]."""
        own = own_vector(state, world, self.identity)
        return {"view": egocentric_view(state, world, forecast, self.radius, self.channels), "self": own}


@dataclass(frozen=True, kw_only=True)
class Surroundings(Local):
    """An agent's own surroundings and the state of the fire, as the paper has it: the default.

    As ``Local``, and ``picture``: what a dispatcher would radio, the whole map's fire (square root of the share of
    each block that burns), fuel and team-mates in 8 x 8 blocks.

    Attributes:
        centred: Whether the agent's own block is the middle of the picture, which then has 15 x 15 blocks, uint8.

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    centred: bool = False

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        side = 2 * PICTURE_SIDE - 1 if self.centred else PICTURE_SIDE
        dtype = torch.uint8 if self.centred else torch.float32
        high: float | tuple[float, ...] = CENTRED_HIGHS if self.centred else 1.0
        return {**super().spaces(world), "picture": Space((len(PICTURE), side, side), dtype, 0, high, PICTURE)}

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``view``, ``self``, and ``picture`` float32 [B, A, 3, 8, 8]."""
        shown = centred_picture(state, forecast) if self.centred else picture(state, forecast)
        return {**super().__call__(state, world, forecast), "picture": shown}


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's view: terrain class, tree age and fire stage about the agent, flattened.

    Off the map the terrain class is 0 and the others too; covers are (code + 1) / 5, ages / 10.2, fire stages / 5.

    Attributes:
        radius: r of the view [cells]; the vector has 3 (2 r + 1)^2 entries.

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    radius: int = 3

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of the one, nameless entry."""
        return {"": Space((3 * (2 * self.radius + 1) ** 2,), torch.float32, 0.0, 1.0)}

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return one entry, float32 [B, A, 3 (2 r + 1)^2]."""
        seen = window(state.vehicles.position, state.cells.shape[1:], self.radius)
        cells = seen.of(state.cells)
        cover = (seen.of(state.landscape.cover) + seen.inside) * 51
        view = torch.stack((cover, ages(cells), stages(cells)), dim=2)
        return {"": view.flatten(2).to(torch.float32).mul_(1.0 / 255.0)}


Observation = Surroundings | Local | Paper
"""Any observation preset."""
