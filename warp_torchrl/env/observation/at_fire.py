"""What the aircraft of Haksar and Schwager see."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.env.observation.presets import Space
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Forecast, WorldState
from warp_torchrl.world.team.places import from_middle, nearest_mate
from warp_torchrl.world.world import World

TOLD = ("clockwise_east", "clockwise_north", "is_later", "from_mate_east", "from_mate_north")
"""Names of the entries of ``told``."""


@dataclass(frozen=True, kw_only=True)
class AtFire:
    """A small image of the forest, the way round its middle, and the nearest team-mate (Haksar and Schwager, IROS
    2018; the numbers are those of the authors' public code).

    ``image`` is the square of 2 r + 1 cells about the agent, flattened by rows, north up: 0 healthy, and beyond the
    map, 1 on fire, 2 burnt. ``told`` has the unit vector clockwise round the middle of the map; 1 where the team-mate
    nearest to the agent has a lower number, else 0; and the unit vector from that team-mate to the agent. A vector is
    0 where it has no direction. Clockwise is another direction in a mirror, so that networks must read what they see as
    it is: ``model.symmetry=none``.

    Attributes:
        radius: r [cells].

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    radius: int = 1

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        if world.sensing.is_limited:
            raise ValueError("sensing must be full with observation=at_fire, which shows what aircraft see as it is")
        cells = (2 * self.radius + 1) ** 2
        return {
            "image": Space((cells,), torch.float32, 0.0, 2.0),
            "told": Space((len(TOLD),), torch.float32, -1.0, 1.0, TOLD),
        }

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``image`` float32 [B, A, (2 r + 1)^2] and ``told`` float32 [B, A, 5]."""
        burnt = (state.burned != 0) & (state.cells == 0)
        codes = is_burning(state.cells).to(torch.uint8) + burnt.to(torch.uint8) * 2
        image = window(state.vehicles.position, state.cells.shape[1:], self.radius).of(codes)
        east, north = unit(from_middle(state)).unbind(-1)
        mate = nearest_mate(state)
        is_later = torch.arange(mate.shape[1], device=mate.device) > mate
        gap = state.vehicles.position - state.vehicles.position.gather(1, mate[..., None].expand(-1, -1, 2))
        away = unit(torch.stack((gap[..., 1], -gap[..., 0]), dim=-1).to(torch.float32))
        told = torch.stack((north, -east, is_later.to(torch.float32), *away.unbind(-1)), dim=-1)
        return {"image": image.flatten(2).to(torch.float32), "told": told}


def unit(vector: Tensor) -> Tensor:
    """Return vectors of length 1 in the direction of vectors, float32 [..., 2]; 0 of 0."""
    return vector / vector.square().sum(-1, keepdim=True).sqrt().clamp(min=1e-9)
