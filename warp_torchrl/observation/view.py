"""What an agent sees about itself: its own square of the map, north up."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.world.flags import byte, equal, narrow
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


@dataclass(frozen=True, eq=False)
class Window:
    """The squares of cells about the agents."""

    index: Tensor
    """Flat index of each cell, moved to the border where it is off the map, int64 [B, A V V]."""
    inside: Tensor
    """1 on the map and 0 beyond, uint8 [B, A, V, V]."""

    def of(self, plane: Tensor) -> Tensor:
        """Return what a plane [B, H, W] of numbers shows, [B, A, V, V]; 0 beyond the map."""
        return plane.flatten(1).gather(1, self.index).view_as(self.inside).mul_(self.inside)


def window(position: Tensor, size: Sequence[int], radius: int) -> Window:
    """Return the squares about the agents.

    Args:
        position: int64 [B, A, 2] [cells].
        size: (H, W) of the map [cells].
        radius: r [cells]; V = 2 r + 1.
    """
    height, width = size
    away = torch.arange(-radius, radius + 1, device=position.device)
    row, column = position[..., 0, None] + away, position[..., 1, None] + away
    on_row, on_column = (row >= 0) & (row < height), (column >= 0) & (column < width)
    index = row.clamp(0, height - 1)[..., None] * width + column.clamp(0, width - 1)[..., None, :]
    return Window(index.flatten(1), narrow(byte(on_row)[..., None] * byte(on_column)[..., None, :]))


def egocentric_view(state: WorldState, world: World, radius: int) -> Tensor:
    """Return the agents' own views in the channels ``CHANNELS``, uint8 [B, A, C, V, V]."""
    seen, elevation = window(state.vehicles.position, state.cells.shape[1:], radius), state.landscape.elevation
    cells = seen.of(state.cells)
    role = world.team.table(cells.device).index
    channels = (
        (1 - seen.inside) * 255,
        _as_byte(seen.of(state.alpha)),
        ages(cells),
        stages(cells),
        seen.of(byte(state.burned)) * byte(equal(cells, 0)) * 255,
        seen.of(byte(state.firebreak)) * 255,
        seen.of(state.wet).clamp_(max=10) * 25,
        seen.inside * 128 if elevation is None else _relative_elevation(elevation, seen),
        _as_byte(seen.of(world.front(state)).add_(seen.of(world.chance(state)))),  # World.threat
        *_others(state.vehicles.position, role, radius).unbind(2),
    )
    return narrow(torch.stack(channels, dim=2))


def ages(cells: Tensor) -> Tensor:
    """Return the ages of trees, 25 a year of ten, uint8, shape of the cells."""
    return cells * byte(is_tree(cells)) * 25


def stages(cells: Tensor) -> Tensor:
    """Return the stages of fires, 51 each, uint8, shape of the cells."""
    return (cells - (FIRST_FIRE - 1)) * byte(is_burning(cells)) * 51


def _as_byte(fractions: Tensor) -> Tensor:
    """Return 255 times numbers in 0..1, cut to whole ones, uint8; the numbers are used up."""
    return fractions.mul_(255.0).to(torch.int32).to(torch.uint8)  # at once it takes twice the time


def _relative_elevation(elevation: Tensor, seen: Window) -> Tensor:
    heights = seen.of(elevation)
    middle = heights.shape[-1] // 2
    own = heights[:, :, middle, middle, None, None]
    return ((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0).to(torch.uint8)


def _others(position: Tensor, role: Tensor, radius: int) -> Tensor:
    """Return where the other agents of each role are, 63 each, at most 4 to a cell, uint8 [B, A, R, V, V]."""
    side, roles = 2 * radius + 1, len(ROLE_NAMES)
    row, column = (position[:, None] - position[:, :, None] + radius).unbind(-1)  # of each in each other's square
    is_near = (row >= 0) & (row < side) & (column >= 0) & (column < side)
    index = torch.where(is_near, (role * side + row) * side + column, roles * side**2)
    count = torch.zeros(*row.shape[:2], roles * side**2 + 1, dtype=torch.uint8, device=role.device)
    count = count.scatter_add(2, index, torch.ones_like(index, dtype=torch.uint8))[..., :-1]
    middle = one_hot((role * side + radius) * side + radius, roles * side**2).to(torch.uint8)  # the agent's own
    return (count.clamp(max=4) - middle).mul_(63).unflatten(-1, (roles, side, side))
