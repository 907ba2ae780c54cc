"""Means of maps over blocks, and sums about each cell."""

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from warp_torchrl.world.arrays.bytes import byte
from warp_torchrl.world.arrays.compile import is_fused


def block_means(maps: Tensor, side: int) -> Tensor:
    """Return the means of maps over side x side blocks, float32 [..., side, side].

    Where the map divides into equal blocks they are sums of slices, which on CPUs is several times faster than pooling.

    Args:
        maps: float32 or bool [..., H, W]; of a bool map, the share that is set.
        side: Blocks to a side of the map.
    """
    height, width = maps.shape[-2:]
    cells = byte(maps) if maps.dtype == torch.bool else maps
    if height % side or width % side:
        return adaptive_avg_pool2d(cells.to(torch.float32).flatten(0, -3), side).view(*maps.shape[:-2], side, side)
    rows, columns = height // side, width // side
    if rows > 1:
        cells = cells.to(torch.int32) if cells.dtype == torch.uint8 and rows > 255 else cells
        blocks = cells.view(*cells.shape[:-2], side, rows, width)
        # A function that is fused keeps this sum, and would not keep that of the slices.
        cells = blocks.sum(-2, dtype=blocks.dtype) if is_fused() else _sum(blocks.unbind(-2))
    cells = cells.to(torch.float32)
    if columns > 1:
        cells = _sum(cells.view(*cells.shape[:-1], side, columns).unbind(-1))
    return cells * (side * side / (height * width))


def _sum(parts: tuple[Tensor, ...]) -> Tensor:
    total = parts[0] + parts[1]
    for part in parts[2:]:
        total += part
    return total


def sums_about(maps: Tensor, radius: int) -> Tensor:
    """Return the sums of maps over the cells within a Chebyshev distance of each cell, float32 [..., H, W].

    Args:
        maps: float32 [..., H, W].
        radius: In cells.
    """
    side, flat = 2 * radius + 1, maps.flatten(0, -3)[:, None]
    rows = avg_pool2d(flat, (side, 1), stride=1, padding=(radius, 0))
    return avg_pool2d(rows, (1, side), stride=1, padding=(0, radius)).mul_(side * side).view_as(maps)
