"""What an agent sees about itself: its own square of the map, north up."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import torch
from torch import Tensor
from torch.compiler import is_compiling

from warp_torchrl.world.flags import at_least, byte, equal, narrow, wide
from warp_torchrl.world.fusion import kept_in_memory
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
CHANNEL_HIGHS = (255, 255, 250, 255, 255, 255, 250, 255, 255, 252, 252)
"""Largest number in each of them: ages and wet ticks end at 10 times 25, other agents at 4 times 63."""
ELEVATION_SCALE = 100.0
"""Difference in height that an observation shows as 1 [m]."""


@dataclass(frozen=True, eq=False)
class Window:
    """The squares of cells about the agents."""

    position: Tensor
    """(row, column) of the agents, int64 [B, A, 2] [cells]."""
    radius: int
    """r [cells]; V = 2 r + 1."""
    index: Tensor
    """Flat index of each cell, moved to the border where it is off the map, int64 [B, A V V]."""
    inside: Tensor
    """1 on the map and 0 beyond, uint8 [B, A, V, V]."""

    def of(self, plane: Tensor) -> Tensor:
        """Return what a plane [B, H, W] of numbers shows, [B, A, V, V]; 0 beyond the map."""
        return plane.flatten(1).gather(1, self.index).view_as(self.inside).mul_(self.inside)

    def of_each(self, *planes: Tensor) -> list[Tensor]:
        """Return what up to four planes [B, H, W] of codes 0..255, uint8 or ``wide``, show, likewise.

        A function that is fused reads them at once, as the four bytes of a word.
        """
        if not is_compiling():
            return [self.of(plane) for plane in planes]
        word = reduce(operator.or_, (wide(plane) << 8 * place for place, plane in enumerate(planes)))
        shown = _squares(word, self.position, self.radius)
        return [(shown >> 8 * place) & 255 for place in range(len(planes))]


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
    inside = narrow(byte(on_row)[..., None] * byte(on_column)[..., None, :])
    return Window(position, radius, index.flatten(1), inside)


def _square(plane: Tensor, position: Tensor, radius: int) -> Tensor:
    return plane.new_empty(*position.shape[:2], 2 * radius + 1, 2 * radius + 1)


# A compiler would look up cell after cell, and ask of each whether it is on the map.
@kept_in_memory("(Tensor plane, Tensor position, int radius) -> Tensor", like=_square)
def _squares(plane: Tensor, position: Tensor, radius: int) -> Tensor:
    return window(position, plane.shape[1:], radius).of(plane)


def _as_channels(channels: Sequence[Tensor]) -> Tensor:
    """Return channels [B, A, V, V], uint8 or ``wide``, as one tensor, uint8 [B, A, C, V, V]."""
    return _stacked([narrow(channel).contiguous() for channel in channels] if is_compiling() else list(channels))


# A compiler would write squares of odd sides a few cells at a time.
@kept_in_memory("(Tensor[] channels) -> Tensor")
def _stacked(channels: list[Tensor]) -> Tensor:
    return torch.stack(channels, dim=2)


def egocentric_view(state: WorldState, world: World, radius: int) -> Tensor:
    """Return the agents' own views in the channels ``CHANNELS``, uint8 [B, A, C, V, V]."""
    seen, elevation = window(state.vehicles.position, state.cells.shape[1:], radius), state.landscape.elevation
    code, wet, alpha, threat = _shown(state, world, seen)
    cells, inside = code & _CELLS, byte(at_least(code, _ON_MAP))
    role = world.team.table(cells.device).index
    channels = (
        (inside ^ 1) * 255,
        alpha,
        ages(cells),
        stages(cells),
        byte(equal(code & (_CELLS | _BURNED), _BURNED)) * 255,
        byte(equal(code & _FIREBREAK, _FIREBREAK)) * 255,
        wet.clamp_(max=10) * 25,
        inside * 128 if elevation is None else _relative_elevation(elevation, seen),
        threat,
        *_others(state.vehicles.position, role, radius).unbind(2),
    )
    return _as_channels(channels)


_CELLS, _BURNED, _FIREBREAK, _ON_MAP = 0x0F, 0x10, 0x20, 0x40


def _shown(state: WorldState, world: World, seen: Window) -> list[Tensor]:
    """Return the agents' squares of the map in bytes, uint8 or ``wide`` [B, A, V, V] each.

    They are the cells' codes, with what has burned, firebreaks and the map as bits above them, and how wet, flammable
    and threatened (``World.threat``) they are.
    """
    burned, firebreak = wide(state.burned.view(torch.uint8)), wide(state.firebreak.view(torch.uint8))
    code = torch.add(wide(state.cells), burned, alpha=_BURNED).add_(firebreak, alpha=_FIREBREAK).add_(_ON_MAP)
    if is_compiling():
        return seen.of_each(code, state.wet, _share(state.alpha), _share(world.threat(state)))
    threat = seen.of(world.front(state)).add_(seen.of(world.chance(state)))
    return [*seen.of_each(code, state.wet), _share(seen.of(state.alpha)), _share(threat)]


def ages(cells: Tensor) -> Tensor:
    """Return the ages of trees, 25 a year of ten, uint8, shape of the cells."""
    return cells * byte(is_tree(cells)) * 25


def stages(cells: Tensor) -> Tensor:
    """Return the stages of fires, 51 each, uint8, shape of the cells."""
    return (cells - (FIRST_FIRE - 1)) * byte(is_burning(cells)) * 51


def _share(fractions: Tensor) -> Tensor:
    """Return 255 times numbers in 0..1, cut to whole ones, uint8 or ``wide``."""
    return _as_codes(fractions * 255.0)


def _as_codes(numbers: Tensor) -> Tensor:
    """Return numbers in 0..255, cut to whole ones, uint8 or ``wide``."""
    codes = numbers.to(torch.int32)
    return codes if is_compiling() else codes.to(torch.uint8)  # at once it takes twice the time


def _relative_elevation(elevation: Tensor, seen: Window) -> Tensor:
    heights = seen.of(elevation)
    middle = heights.shape[-1] // 2
    own = heights[:, :, middle, middle, None, None]
    return _as_codes(((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0))


def _others(position: Tensor, role: Tensor, radius: int) -> Tensor:
    """Return where the other agents of each role are, 63 each, at most 4 to a cell, uint8 [B, A, R, V, V]."""
    side, roles = 2 * radius + 1, len(ROLE_NAMES)
    row, column = (position[:, None] - position[:, :, None] + radius).unbind(-1)  # of each in each other's square
    is_near = (row >= 0) & (row < side) & (column >= 0) & (column < side)
    is_near &= ~torch.eye(len(role), dtype=torch.bool, device=role.device)
    index = torch.where(is_near, (role * side + row) * side + column, roles * side**2)
    count = torch.zeros(*row.shape[:2], roles * side**2 + 1, dtype=torch.uint8, device=role.device)
    count = count.scatter_add(2, index, torch.ones_like(index, dtype=torch.uint8))[..., :-1]
    return count.clamp(max=4).mul_(63).unflatten(-1, (roles, side, side))
