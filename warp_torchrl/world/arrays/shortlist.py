"""The first marked cells of each world as lists whose length has a bound."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.listing import filled, flat_cells, list_cells


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


def marked_cells(mask: Tensor) -> Tensor:
    """Return what ``flat_cells`` does of a mask, int64 [N]; in functions that are fused, every cell."""
    return torch.arange(mask.numel(), device=mask.device) if is_fused() else flat_cells(mask)
