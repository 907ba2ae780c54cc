"""The moves from each agent to cells, around what blocks it: all agents' searches run at once, as the bits of bytes.

Each round of a search adds the neighbours of the cells that it has reached. The maps lie in one row
(``rows``), closed cells behind each row of each, so that the neighbours are the whole row, shifted.

In which round a cell was reached is kept in Gray code, bit by bit: from one round to the next one bit alone differs, so
that a round writes one plane of bits, of all cells that it has not reached.
"""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.distances import FAR
from warp_torchrl.world.arrays.row_layout import in_a_row

_TOGETHER = 8
"""Agents whose searches are the bits of one byte."""
_ROUNDS = 8
"""Rounds between two looks at whether a search has ended."""


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
    """Bit-packed breadth-first search: moves from each agent's start to each cell, int32 [B, A, K].

    ``start`` and ``passable`` are uint8 [B, H, W], with a bit for each agent, ``bit`` [A, 1]. On a device that would
    have to synchronise, the search runs the largest number of rounds, without reading results.
    """
    worlds, height, width = start.shape
    reads, most, wide = needs_no_sync(start.device), 2 * (height + width), width + 1
    first = torch.arange(worlds, device=start.device)[:, None, None] * (height + 1) * wide
    index = first + cells + cells // width
    grow = _Round(in_a_row(passable | start), wide)
    reached = grow.without_margins(in_a_row(start))
    planes = reached.new_zeros(most.bit_length(), len(reached))
    for turn in range(1, most + 1):
        bit_that_differs = (turn & -turn).bit_length() - 1  # between the codes of this round and the one before
        planes[bit_that_differs] ^= reached
        before, reached = reached, grow(reached)
        if reads and turn % _ROUNDS == 0 and (torch.equal(before, reached) or bool((reached[index] & bit).all())):
            break
    moves = _decoded(planes[: turn.bit_length()], index, bit) ^ turn
    return torch.where((reached[index] & bit) == 0, FAR, moves.to(torch.int32))


class _Round:
    """One round of a search, with the memory that all rounds share and views of it: most maps are so small that to make
    a view takes as long as to compute with it.

    Args:
        passable: Cells from which the search goes on, maps in a row with margins, uint8.
        wide: Cells from one row of a map to the next.
    """

    def __init__(self, passable: Tensor, wide: int) -> None:
        source, self.margin = torch.zeros_like(passable), wide + 1
        self.passable, self.source = self.without_margins(passable), self.without_margins(source)
        self.beside = (source[:-2], source[1:-1], source[2:])
        self.rows = torch.empty_like(source[2:])
        self.around = (self.rows[: -2 * wide], self.rows[wide:-wide], self.rows[2 * wide :])

    def without_margins(self, row: Tensor) -> Tensor:
        """Return the maps of a row, uint8 [N]."""
        return row[self.margin : -self.margin]

    def __call__(self, reached: Tensor) -> Tensor:
        """Return the bits of each cell and of its eight neighbours that are passable, uint8 [N]."""
        torch.bitwise_and(reached, self.passable, out=self.source)
        west, here, east = self.beside
        torch.bitwise_or(west, here, out=self.rows).bitwise_or_(east)
        north, here, south = self.around
        return torch.bitwise_or(north, here).bitwise_or_(south)


def _decoded(planes: Tensor, index: Tensor, bit: Tensor) -> Tensor:
    """Return the numbers whose Gray codes stand in planes of bits uint8 [P, N], int16 [B, A, K], at the indices."""
    above, number = torch.zeros_like(planes[0]), torch.zeros(1, dtype=torch.int16, device=planes.device)
    for plane in planes.flip(0):
        above = above ^ plane
        number = 2 * number + ((above[index] & bit) != 0)
    return number
