"""Marked cells as lists, so that later work grows with them and not with the map."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.compile import is_fused

VECTORS = 64
"""What the length of a list is a multiple of where its numbers must not depend on the batch: some of torch's operations
(pow, atan2) round otherwise in a last part that does not fill their vectors."""


def list_cells(mask: Tensor) -> tuple[Tensor, Tensor]:
    """Return the marked cells of each world in row-major order, so that later work scales with them, not with the map.

    Args:
        mask: bool [B, H, W].

    Returns:
        Flat indices, int64 [B, K], with K the largest count of any world, at least 1; and which indices are not
        padding, bool [B, K]. On a device that would have to synchronise, every cell: K = H W, and the mask.
    """
    marked = mask.flatten(1)
    if not needs_no_sync(mask.device):
        return torch.arange(marked.shape[1], device=mask.device).expand_as(marked), marked
    world, cell = marked.nonzero().unbind(dim=1)
    counts = torch.bincount(world, minlength=len(marked))  # a sum of bools reads the map again, and slowly
    index = marked.new_zeros(len(marked), max(int(counts.max()), 1), dtype=torch.int64)
    index[world, torch.arange(len(world), device=mask.device) - (counts.cumsum(0) - counts)[world]] = cell
    return index, torch.arange(index.shape[1], device=mask.device) < counts[:, None]


def filled(count: int) -> int:
    """Return the least number of cells that fill vectors, ``count`` or more and 64 at least."""
    return max(1, -(-count // VECTORS)) * VECTORS


def first_cells(mask: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Return the first marked cells of each world in row-major order, on any device without a synchronisation.

    Args:
        mask: bool [B, H, W].
        count: K, how many of each world at most.

    Returns:
        Flat indices, int64 [B, K], and which of them are marked cells, bool [B, K]. Where reading needs no
        synchronisation K is no longer than the marks of any world need, in whole vectors.
    """
    if needs_no_sync(mask.device) and not is_fused():
        index, is_there = list_cells(mask)
        length = min(count, filled(index.shape[1]))
        more = max(0, length - index.shape[1])
        return pad(index[:, :length], (0, more)), pad(is_there[:, :length], (0, more))
    marked = mask.flatten(1)
    rank = marked.cumsum(dim=1)
    slot = torch.where(marked & (rank <= count), rank - 1, count)
    cell = torch.arange(marked.shape[1], device=mask.device).expand_as(slot)
    index = torch.zeros(len(marked), count + 1, dtype=torch.int64, device=mask.device).scatter_(1, slot, cell)
    return index[:, :count], torch.arange(count, device=mask.device) < rank[:, -1:]
