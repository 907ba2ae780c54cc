"""The shape of a fire: its centre, what is near it, what is downwind, and how far it is shut in."""

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, TreeCounts, WorldState

RAYS = 32
"""Rays from a fire's centre on which barriers are looked for."""


def centre(mask: Tensor) -> Tensor:
    """Return the mean place of marked cells, (row, column) float32 [B, 2]; the map's middle where there are none."""
    height, width = mask.shape[1:]
    weight = mask.to(torch.float32)
    count = weight.sum((1, 2))
    rows = torch.arange(height, dtype=torch.float32, device=mask.device)
    columns = torch.arange(width, dtype=torch.float32, device=mask.device)
    row = (weight.sum(2) * rows).sum(1) / count.clamp(min=1.0)
    column = (weight.sum(1) * columns).sum(1) / count.clamp(min=1.0)
    none = count == 0.0
    return torch.stack((row.masked_fill(none, (height - 1) / 2.0), column.masked_fill(none, (width - 1) / 2.0)), dim=1)


def alignment(place: Tensor, middle: Tensor, wind: Tensor) -> Tensor:
    """Return the cosine of the angle between the wind and the way from the fire's centre to a place.

    Args:
        place: (row, column), [B, A, 2] [cells].
        middle: The fire's centre, [B, 2] [cells].
        wind: (u, v), [B, 2, h, w] [m/s]; its mean over the map counts.

    Returns:
        float32 [B, A] in -1..1; 0 at the centre and without wind.
    """
    u, v = wind.mean((2, 3)).unbind(1)
    south, east = (place - middle[:, None]).unbind(-1)
    along = east * u[:, None] - south * v[:, None]
    return along / (torch.hypot(south, east) * torch.hypot(u, v)[:, None]).clamp(min=1e-6)


def sector(place: Tensor, middle: Tensor, count: int = 8) -> Tensor:
    """Return in which of ``count`` equal sectors about the fire's centre a place lies, int64 [B, A].

    Args:
        place: (row, column), [B, A, 2] [cells].
        middle: The fire's centre, [B, 2] [cells].
        count: Sectors; 0 begins in the east, and they go round clockwise.
    """
    south, east = (place - middle[:, None]).unbind(-1)
    turn = torch.atan2(south, east) / (2.0 * math.pi)
    return (turn.remainder(1.0) * count).to(torch.int64).clamp(max=count - 1)


def spreading_front(cells: Tensor, alpha: Tensor) -> Tensor:
    """Return the burning cells that can spread: before the last stage, beside a tree that can burn.

    Args:
        cells: Codes as they are, or as an agent knows them, [..., H, W].
        alpha: Flammability, float32 [..., H, W].

    Returns:
        bool, shape of the cells.
    """
    fuel = (cells >= 1) & (cells <= OLDEST) & (alpha > 0.0)
    return (cells >= FIRST_FIRE) & (cells < EMBER) & grow(fuel)


def exposure(state: WorldState, counts: TreeCounts, reach: int = 3) -> Tensor:
    """Return the trees that could burn within a Chebyshev distance ``reach`` of fire, a share of N0, float32 [B]."""
    fuel = is_tree(state.cells) & (state.alpha > 0.0)
    near = grow(is_burning(state.cells), reach) & fuel
    return near.sum((1, 2)) / counts.initial


def containment(fire: Tensor, barrier: Tensor) -> Tensor:
    """Return the share of rays from the fire's centre to the border that meet a barrier, float32 [B].

    1 where there is no fire.

    Args:
        fire: The cells that count as fire, bool [B, H, W].
        barrier: The cells that stop a ray, bool [B, H, W].
    """
    height, width = fire.shape[1:]
    steps = _rays(max(height, width), fire.device)
    place = (centre(fire)[:, None, None] + steps).round().to(torch.int64)
    row, column = place.unbind(-1)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    index = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
    met = barrier.flatten(1).gather(1, index.flatten(1)).view_as(index) & inside
    share = met.any(dim=2).to(torch.float32).mean(dim=1)
    return share.masked_fill(~fire.flatten(1).any(dim=1), 1.0)


def block_shares(mask: Tensor, among: Tensor, side: int = 8) -> Tensor:
    """Return the share of the cells of ``among`` that are marked in each block of the map, float32 [B, h, w].

    Blocks at the south and east border may be smaller; one with no cell of ``among`` has share 0.
    """

    def count(cells: Tensor) -> Tensor:
        return avg_pool2d(cells.to(torch.float32)[:, None], side, ceil_mode=True, divisor_override=1)[:, 0]

    return count(mask & among) / count(among).clamp(min=1.0)


@kept(16)
def _rays(length: int, device: torch.device) -> Tensor:
    """Return the steps along each ray, a cell's side apart, float32 [rays, length, 2]."""
    angle = torch.arange(RAYS, device=device) * (2.0 * math.pi / RAYS)
    step = torch.arange(1, length + 1, device=device)
    return torch.stack((torch.outer(angle.sin(), step), torch.outer(angle.cos(), step)), dim=-1)
