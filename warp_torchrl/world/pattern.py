"""Chances from a table: under one wind and on level ground, a cell's depends on its kind and its burning neighbours.

There are 256 patterns of burning neighbours, so a small table holds every chance that a world's ticks can meet.
"""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.flags import byte
from warp_torchrl.world.geometry import DIRECTIONS
from warp_torchrl.world.law import Law
from warp_torchrl.world.spread import directions


def pattern_table(law: Law, susceptibility: Tensor, gain: Tensor, neighbours: int = 8) -> Tensor:
    """Return the chance to ignite of each kind of ground under each pattern of burning neighbours.

    Args:
        law: What makes chances of strengths.
        susceptibility: Each kind's part of a strength, float32 [G].
        gain: Of ``spread.gains``, float32 [B, 8, 1, 1].
        neighbours: 8 or 4.

    Returns:
        float32 [B, G + 1, 2^neighbours]; the first kind is of cells that cannot ignite, all 0.
    """
    strengths = gain[..., 0] * pad(susceptibility, (1, 0))
    total = torch.zeros_like(strengths[:, 0, :, None])
    for direction in directions(neighbours):  # doubles the patterns: as they were, and with this neighbour too
        strength = strengths[:, direction, :, None].expand_as(total).clone()
        joined = total.clone()
        law.join(joined, strength, torch.empty_like(total))
        total = torch.cat((total, joined), dim=-1)
    return law.chance(total)


def chance_by_pattern(table: Tensor, spreading: Tensor, kind: Tensor, neighbours: int = 8) -> Tensor:
    """Return what ``spread.ignition_chance`` does of level worlds with one wind each, to the bit.

    Args:
        table: Of ``pattern_table``, float32 [B, G + 1, 2^neighbours].
        spreading: The burning cells that ignite others, bool [B, H, W].
        kind: Row of the table, 0 for a cell that cannot ignite, uint8 [B, H, W].
        neighbours: 8 or 4.

    Returns:
        float32 [B, H, W].
    """
    pattern = burning_neighbours(spreading, neighbours)
    index = torch.add(pattern.to(torch.int16), kind.to(torch.int16), alpha=table.shape[-1]).to(torch.int64)
    return table.flatten(1).gather(1, index.flatten(1)).view(kind.shape)


def burning_neighbours(spreading: Tensor, neighbours: int = 8) -> Tensor:
    """Return which neighbours of each cell spread fire, uint8 [B, H, W]: one bit for each direction it comes in."""
    worlds, height, width = spreading.shape
    cells = height * width
    sources = {column: _all_but_one_column(byte(spreading), column) for column in (-1, 0, 1)}
    pattern = torch.zeros(worlds, cells, dtype=torch.uint8, device=spreading.device)
    for bit, direction in enumerate(directions(neighbours)):
        row, column = DIRECTIONS[direction]
        rows = (height - abs(row)) * width  # a world's cells that have a neighbour in that row: one slice of it
        source = sources[column].as_strided((worlds, rows), (cells, 1), 1 + max(-row, 0) * width - column)
        pattern[:, max(row, 0) * width :][:, :rows].add_(source, alpha=1 << bit)
    return pattern.view_as(spreading)


def _all_but_one_column(mask: Tensor, column: int) -> Tensor:
    """Return maps, uint8 [B, H, W], in a row with a zero at both ends, [B H W + 2], without what travels off the map.

    That is their last column for travel to the east, column 1, and their first for travel to the west, column -1.
    """
    row = mask.new_empty(mask.numel() + 2)
    row[0] = row[-1] = 0
    maps = row[1:-1].view_as(mask).copy_(mask)
    if column:
        maps[:, :, -1 if column > 0 else 0] = 0
    return row
