"""Chebyshev distances from agents to cells."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import byte
from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.counting import counting

FAR = 30_000
"""Distance reported where there is nothing to be near to [cells]; fits in int16."""


def chebyshev_distance(position: Tensor, mask: Tensor) -> Tensor:
    """Return each agent's distance to every marked cell, the Chebyshev distance.

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
    lines = counting(max(height, width), position) - position.to(torch.int32)[..., None]
    rows, columns = lines.abs_().to(dtype).unbind(-2)
    distance = torch.maximum(rows[..., :height, None], columns[..., None, :width])
    beyond = (byte(mask) ^ 1).to(dtype) * far  # a maximum is many times faster than masked_fill
    return torch.maximum(distance, beyond[:, None])


def distance_to_nearest(position: Tensor, mask: Tensor) -> Tensor:
    """Return each agent's distance to the nearest marked cell, the Chebyshev distance.

    Args:
        position: (row, column) of the agents, int64 [B, A, 2] [cells].
        mask: The cells that count, bool [B, H, W].

    Returns:
        int16 [B, A] [cells]; ``FAR`` where nothing is marked.
    """
    if is_fused():
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
