"""The grid's directions and distances.

Rows grow south and columns grow east. Direction 0 is north; the eight directions go round clockwise, so
direction ``d`` and ``(d + 4) % 8`` are opposite.
"""

import math

import torch
from torch import Tensor
from torch.compiler import is_compiling

from warp_torchrl.world.constants import counting
from warp_torchrl.world.flags import byte

DIRECTIONS = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
"""(row, column) offset of N, NE, E, SE, S, SW, W, NW [cells]."""

DISTANCES = tuple(math.hypot(row, column) for row, column in DIRECTIONS)
"""Distance to the neighbour in each direction [cells]: 1 along the axes, sqrt(2) along the diagonals."""

FAR = 30_000
"""Distance reported where there is nothing to be near to [cells]; fits in int16."""


def unit_vectors(device: torch.device | str = "cpu") -> Tensor:
    """Return the unit vector (east, north) of each direction, float32 [N, 2]."""
    rows = [(column / length, -row / length) for (row, column), length in zip(DIRECTIONS, DISTANCES, strict=True)]
    return torch.tensor(rows, device=device)


def chebyshev_distance(position: Tensor, mask: Tensor) -> Tensor:
    """Return each agent's distance to every marked cell, the number of king's moves to it.

    Args:
        position: (row, column) of the agents, int64 [B, A, 2] [cells].
        mask: The cells that count, bool [B, H, W].

    Returns:
        int16 [B, A, H, W] [cells]; ``FAR`` where the mask is False.
    """
    return _moves(position, mask, torch.int16, FAR)


def _moves(position: Tensor, mask: Tensor, dtype: torch.dtype, far: int) -> Tensor:
    """Return what ``chebyshev_distance`` does, of another type and ``far`` where the mask is False."""
    height, width = mask.shape[-2:]
    place = position.to(torch.int32)
    row_distance = (counting(height, position) - place[..., :1]).abs_().to(dtype)
    column_distance = (counting(width, position) - place[..., 1:]).abs_().to(dtype)
    distance = torch.maximum(row_distance[..., :, None], column_distance[..., None, :])
    beyond = (byte(mask) ^ 1).to(dtype) * far  # a maximum is many times faster than masked_fill
    return torch.maximum(distance, beyond[:, None])


def distance_to_nearest(position: Tensor, mask: Tensor) -> Tensor:
    """Return each agent's distance to the nearest marked cell, the number of king's moves to it.

    Args:
        position: (row, column) of the agents, int64 [B, A, 2] [cells].
        mask: The cells that count, bool [B, H, W].

    Returns:
        int16 [B, A] [cells]; ``FAR`` where nothing is marked.
    """
    if is_compiling():
        return _moves(position, mask, torch.int32, FAR).flatten(2).amin(2).to(torch.int16)
    if max(mask.shape[-2:]) > 255:
        return chebyshev_distance(position, mask).flatten(2).amin(2)
    distance = _moves(position, mask, torch.uint8, 255).flatten(2).amin(2)  # bytes are many times faster
    return torch.where(distance == 255, FAR, distance.to(torch.int16))


def nearest(position: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Return each agent's distance to the nearest marked cell and that cell's flat index.

    Ties go to the first cell in row-major order.

    Args:
        position: int64 [B, A, 2] [cells].
        mask: bool [B, H, W].

    Returns:
        Distance int16 [B, A] [cells], ``FAR`` where nothing is marked, and index int64 [B, A] into H * W.
    """
    distance = chebyshev_distance(position, mask).flatten(2)
    best = distance.min(dim=-1)
    return best.values, best.indices


def grow(mask: Tensor, radius: int = 1) -> Tensor:
    """Return the cells within ``radius`` king's moves of a marked cell, bool [B, H, W]."""
    for _ in range(radius):
        rows = mask.clone()
        rows[:, 1:] |= mask[:, :-1]
        rows[:, :-1] |= mask[:, 1:]
        mask = rows.clone()
        mask[:, :, 1:] |= rows[:, :, :-1]
        mask[:, :, :-1] |= rows[:, :, 1:]
    return mask


def flood(seeds: Tensor, open_cells: Tensor) -> Tensor:
    """Return the open cells that a king's walk over open cells reaches from the seeds.

    The walk is followed for 2 (H + W) steps, a fixed number, so that no value is ever read back from the device;
    only a labyrinth holds longer shortest paths.

    Args:
        seeds: bool [B, H, W]; a seed need not be open.
        open_cells: bool [B, H, W].

    Returns:
        bool [B, H, W].
    """
    reached = seeds
    passable = open_cells | seeds
    for _ in range(2 * sum(seeds.shape[-2:])):
        reached = grow(reached) & passable
    return reached & open_cells
