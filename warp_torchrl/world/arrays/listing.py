"""Marked cells as lists, so that later work grows with them and not with the map."""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync

VECTORS = 64
"""What the length of a list is a multiple of where its numbers must not depend on the batch: some of torch's operations
(pow, atan2) round otherwise in a last part that does not fill their vectors."""
_WORD = 8  # bytes


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


def flat_cells(mask: Tensor) -> Tensor:
    """Return the marked cells of all worlds, flat indices in [B, H, W], int64 [N].

    On a device that would have to synchronise, every cell.
    """
    if needs_no_sync(mask.device):
        return places(mask.flatten().view(torch.uint8))
    return torch.arange(mask.numel(), device=mask.device)


def places(codes: Tensor) -> Tensor:
    """Return where codes are not 0, int64 [N]; codes are uint8 [n].

    Most words of eight codes hold none, and are passed over as words.
    """
    if codes.numel() % _WORD:
        return codes.nonzero()[:, 0]
    words = codes.view(torch.int64)
    word = words.nonzero()[:, 0]
    found = words.index_select(0, word).view(torch.uint8).nonzero()[:, 0]
    return word.index_select(0, found >> 3).mul_(_WORD).add_(found & (_WORD - 1))


def in_all(cell: Tensor, count: int) -> Tensor:
    """Return flat indices in each map of ``count`` cells, int64 [B, n], as those in all maps, int64 [B, n]."""
    return cell + torch.arange(0, len(cell) * count, count, device=cell.device)[:, None]


def filled(count: int) -> int:
    """Return the least number of cells that fill vectors, ``count`` or more and 64 at least."""
    return max(1, -(-count // VECTORS)) * VECTORS
