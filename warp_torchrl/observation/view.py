"""What an agent sees about itself: its own square of the map, north up."""

import torch
from torch import Tensor

from warp_torchrl.world.fast.bytes import at_least, byte, equal, to_codes, to_int32
from warp_torchrl.world.fast.squares import Window, stacked, window
from warp_torchrl.world.role import ROLE_NAMES
from warp_torchrl.world.state import FIRST_FIRE, Forecast, WorldState, is_burning, is_tree
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


def egocentric_view(state: WorldState, world: World, forecast: Forecast, radius: int) -> Tensor:
    """Return the agents' own views in the channels ``CHANNELS``, uint8 [B, A, C, V, V]."""
    seen, elevation = window(state.vehicles.position, state.cells.shape[1:], radius), state.landscape.elevation
    code, wet, alpha, risk = _shown(state, forecast, seen)
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
        risk,
        *_others(state.vehicles.position, role, radius).unbind(2),
    )
    return stacked(channels)


_CELLS, _BURNED, _FIREBREAK, _ON_MAP = 0x0F, 0x10, 0x20, 0x40


def _shown(state: WorldState, forecast: Forecast, seen: Window) -> list[Tensor]:
    """Return the agents' squares of the map in bytes [B, A, V, V] each.

    They are the cells' codes, with what has burned, firebreaks and the map as bits above them, and how wet, flammable
    and at risk (``Forecast.fire_risk``) they are.
    """
    burned, firebreak = to_int32(state.burned.view(torch.uint8)), to_int32(state.firebreak.view(torch.uint8))
    code = torch.add(to_int32(state.cells), burned, alpha=_BURNED).add_(firebreak, alpha=_FIREBREAK).add_(_ON_MAP)
    risk = forecast.expected_ignitions, forecast.ignition_probability
    return seen.bytes_of([code, state.wet], [(state.alpha,), risk])


def ages(cells: Tensor) -> Tensor:
    """Return the ages of trees, 25 a year of ten, uint8, shape of the cells."""
    return cells * byte(is_tree(cells)) * 25


def stages(cells: Tensor) -> Tensor:
    """Return the stages of fires, 51 each, uint8, shape of the cells."""
    return (cells - (FIRST_FIRE - 1)) * byte(is_burning(cells)) * 51


def _relative_elevation(elevation: Tensor, seen: Window) -> Tensor:
    heights = seen.of(elevation)
    middle = heights.shape[-1] // 2
    own = heights[:, :, middle, middle, None, None]
    return to_codes(((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0))


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
