"""What agents may be shown: a preset is a component.

Its ``spaces`` tell the environment the shape, type and range of each entry, and called with a state it returns them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.observation.coarse import CENTRED_HIGHS, PICTURE, PICTURE_SIDE, centred_picture, picture
from warp_torchrl.observation.own import IDENTITY_SIZE, SELF_SIZE, identity, own_vector
from warp_torchrl.observation.view import CHANNEL_HIGHS, CHANNELS, ages, egocentric_view, stages, window
from warp_torchrl.validation import check_fields
from warp_torchrl.world.state import WorldState
from warp_torchrl.world.world import World


class Space(NamedTuple):
    """Shape (one agent's), type and range of an entry of an observation."""

    shape: tuple[int, ...]
    dtype: torch.dtype
    low: float
    high: float | tuple[float, ...]  # of all numbers, or one for each channel

    def bounds(self) -> tuple[Tensor, Tensor]:
        """Return the least and the largest value of each number, both of the entry's shape and type."""
        low, high = torch.full(self.shape, self.low, dtype=self.dtype), torch.tensor(self.high, dtype=self.dtype)
        per_channel = high.view(-1, *[1] * (len(self.shape) - 1)) if high.ndim else high
        return low, per_channel.expand(self.shape).contiguous()


@dataclass(frozen=True, kw_only=True)
class Local:
    """What an agent sees of its own surroundings, and nothing else.

    ``view`` is the square of 2 r + 1 cells about the agent, north up, in the channels ``CHANNELS``, uint8: fractions
    times 255, elevation relative to the agent's cell as 128 + 127 dz / 100 m, other agents 63 each. ``self`` is what
    it knows of itself, see ``SELF_SIZE``.

    Attributes:
        radius: r [cells].
        identity: Whether ``self`` ends with the agent's place in its team, see ``identity``: agents that stand together
            and see the same can then part.

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    radius: int = 5
    identity: bool = False

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        side = 2 * self.radius + 1
        return {
            "view": Space((len(CHANNELS), side, side), torch.uint8, 0, CHANNEL_HIGHS),
            "self": Space((SELF_SIZE + IDENTITY_SIZE * self.identity,), torch.float32, -3.0, 3.0),
        }

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return ``view`` uint8 [B, A, C, V, V] and ``self`` float32 [B, A, F]."""
        own = own_vector(state, world)
        if self.identity:
            who = identity(own.shape[1], own.device)
            own = torch.cat((own, who.expand(len(own), -1, -1)), dim=-1)
        return {"view": egocentric_view(state, world, self.radius), "self": own}


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
        return {**super().spaces(world), "picture": Space((len(PICTURE), side, side), dtype, 0, high)}

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return ``view``, ``self``, and ``picture`` float32 [B, A, 3, 8, 8]."""
        shown = centred_picture(state, world) if self.centred else picture(state, world)
        return {**super().__call__(state, world), "picture": shown}


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

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return one entry, float32 [B, A, 3 (2 r + 1)^2]."""
        seen = window(state.vehicles.position, state.cells.shape[1:], self.radius)
        cells = seen.of(state.cells)
        cover = (seen.of(state.landscape.cover) + seen.inside) * 51
        view = torch.stack((cover, ages(cells), stages(cells)), dim=2)
        return {"": view.flatten(2).to(torch.float32).mul_(1.0 / 255.0)}


Observation = Surroundings | Local | Paper
"""Any observation preset."""
