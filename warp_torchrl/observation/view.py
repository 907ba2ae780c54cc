"""What an agent sees about itself: its own square of the map, north up."""

import torch
from torch import Tensor
from torch.nn.functional import one_hot, pad

from warp_torchrl.world.flags import byte, equal
from warp_torchrl.world.role import ROLE_NAMES
from warp_torchrl.world.state import FIRST_FIRE, WorldState, is_burning, is_tree
from warp_torchrl.world.world import World

CHANNELS = (
    "off_map",
    "flammability",
    "age",
    "fire_stage",
    "ash",
    "firebreak",
    "wet",
    "relative_elevation",
    "threat",
    "other_ugv",
    "other_uav",
)
"""Channels of ``view``."""
ELEVATION_SCALE = 100.0
"""Difference in height that an observation shows as 1 [m]."""


def crop(planes: Tensor, position: Tensor, radius: int) -> Tensor:
    """Cut the square about each agent out of its world's maps; beyond the border it is 0.

    Args:
        planes: Any type, [B, C, H, W].
        position: int64 [B, A, 2] [cells].
        radius: r [cells].

    Returns:
        [B, A, C, V, V], V = 2 r + 1.
    """
    worlds, channels = planes.shape[:2]
    side = 2 * radius + 1
    padded = pad(planes, (radius, radius, radius, radius))
    height, width = padded.shape[2:]
    rows = padded.flatten().as_strided((padded.numel() - side + 1, side), (1, 1))
    device = planes.device
    plane = torch.arange(worlds * channels, device=device).view(worlds, 1, channels, 1) * height
    row = position[..., 0, None, None] + torch.arange(side, device=device)
    start = (plane + row) * width + position[..., 1, None, None]
    return rows.index_select(0, start.flatten()).view(*start.shape, side)


def egocentric_view(state: WorldState, world: World, radius: int) -> Tensor:
    """Return the agents' own views in the channels ``CHANNELS``, uint8 [B, A, C, V, V]."""
    cells, vehicles = state.cells, state.vehicles
    empty = equal(cells, 0)
    ugv, uav = _occupancy(state, world)
    planes = torch.stack(
        (
            torch.full_like(cells, 255),
            (state.alpha * 255.0).to(torch.uint8),
            age_plane(state),
            stage_plane(state),
            byte(state.burned & empty) * 255,
            byte(state.firebreak) * 255,
            state.wet.clamp(max=10) * 25,
            torch.full_like(cells, 128),
            (world.threat(state) * 255.0).to(torch.uint8),
            ugv,
            uav,
        ),
        dim=1,
    )
    view = crop(planes, vehicles.position, radius)
    view[:, :, 0].neg_().sub_(1)  # on the map 255 -> 0, beyond it 0 -> 255
    if state.landscape.elevation is not None:
        view[:, :, 7] = _relative_elevation(state, radius)
    role = world.team.table(cells.device).index
    others = view[:, :, -len(ROLE_NAMES) :, radius, radius]
    others -= one_hot(role, len(ROLE_NAMES)).to(torch.uint8) * 63
    return view


def age_plane(state: WorldState) -> Tensor:
    """Return the ages of trees, 25 a year of ten, uint8 [B, H, W]."""
    return state.cells * byte(is_tree(state.cells)) * 25


def stage_plane(state: WorldState) -> Tensor:
    """Return the stages of fires, 51 each, uint8 [B, H, W]."""
    return (state.cells - (FIRST_FIRE - 1)) * byte(is_burning(state.cells)) * 51


def _relative_elevation(state: WorldState, radius: int) -> Tensor:
    heights = crop(state.landscape.elevation[:, None], state.vehicles.position, radius)[:, :, 0]
    own = heights[:, :, radius, radius, None, None]
    return ((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0).to(torch.uint8)


def _occupancy(state: WorldState, world: World) -> tuple[Tensor, Tensor]:
    """Return where the agents of each role are, 63 each, at most 4 to a cell, uint8 [B, H, W] each."""
    worlds, height, width = state.cells.shape
    position = state.vehicles.position
    role = world.team.table(position.device).index
    index = (role * height + position[..., 0]) * width + position[..., 1]
    count = torch.zeros(worlds, len(ROLE_NAMES) * height * width, dtype=torch.uint8, device=position.device)
    count.scatter_add_(1, index, torch.ones_like(index, dtype=torch.uint8))
    return (count.clamp_(max=4) * 63).view(worlds, len(ROLE_NAMES), height, width).unbind(1)
