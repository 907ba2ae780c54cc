"""The moves from each agent to cells, around what blocks it: all agents' searches run at once, as the bits of bytes."""

import torch
from torch import Tensor

from warp_torchrl.device import reads_freely
from warp_torchrl.world.fast.distances import FAR

_TOGETHER = 8
"""Agents whose searches are the bits of one byte."""


def moves_around(start: Tensor, is_open: Tensor, cells: Tensor) -> Tensor:
    """Return the least number of moves of one cell, in eight directions, from each agent's start to cells.

    A way leads over open cells; its first and its last cell need not be open. Ways of more than 2 (H + W) moves are
    not found.

    Args:
        start: Flat index of each agent's start, int64 [B, A].
        is_open: Where each agent may go, bool [B, 1 or A, H, W].
        cells: Flat indices, int64 [B, 1 or A, K].

    Returns:
        int32 [B, A, K]; ``FAR`` where no way leads.
    """
    if start.shape[1] > _TOGETHER:
        agents = start.shape[1]
        parts = [start, is_open.expand(-1, agents, -1, -1), cells.expand(-1, agents, -1)]
        groups = zip(*(part.split(_TOGETHER, dim=1) for part in parts), strict=True)
        return torch.cat([moves_around(*group) for group in groups], dim=1)
    bit = (1 << torch.arange(start.shape[1], device=start.device)).to(torch.uint8)
    passable = (is_open * bit[:, None, None]).sum(1, dtype=torch.uint8)
    reached = torch.zeros_like(passable).flatten(1).scatter_add_(1, start, bit.expand_as(start)).view_as(passable)
    return _counted(reached, passable, cells, bit[:, None])


def moves_from(marked: Tensor, is_open: Tensor, cells: Tensor) -> Tensor:
    """Return the least number of moves from any marked cell to others, int32 [B, K]; else as ``moves_around``.

    Args:
        marked: bool [B, H, W].
        is_open: bool [B, H, W].
        cells: Flat indices, int64 [B, K].
    """
    bit = torch.ones(1, 1, dtype=torch.uint8, device=marked.device)
    return _counted(marked.to(torch.uint8), is_open.to(torch.uint8), cells[:, None], bit)[:, 0]


def _counted(start: Tensor, passable: Tensor, cells: Tensor, bit: Tensor) -> Tensor:
    """Return what ``moves_around`` does, of starts and open cells uint8 [B, H, W] of which each agent has a bit [A, 1].

    Nothing is read back from a device where that is not free: there the search takes as many rounds as it may.
    """
    reads, index, touched = reads_freely(start.device), cells.flatten(1), start
    moves = torch.zeros(1, dtype=torch.int32, device=start.device)
    for _ in range(2 * sum(start.shape[1:])):
        missing = (touched.flatten(1).gather(1, index).view_as(cells) & bit) == 0
        grown = _grown(touched & (passable | start))
        if reads and (not missing.any() or torch.equal(grown, touched)):
            break
        moves, touched = moves + missing, grown
    missing = (touched.flatten(1).gather(1, index).view_as(cells) & bit) == 0
    return torch.where(missing, FAR, moves)


def _grown(bits: Tensor) -> Tensor:
    """Return the bits of each cell and its eight neighbours together, uint8 [B, H, W]."""
    rows = bits.clone()
    rows[:, 1:] |= bits[:, :-1]
    rows[:, :-1] |= bits[:, 1:]
    grown = rows.clone()
    grown[..., 1:] |= rows[..., :-1]
    grown[..., :-1] |= rows[..., 1:]
    return grown
