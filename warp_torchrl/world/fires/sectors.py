"""Sectors of a fire's front: equal angles about the middle of what has burned."""

import math

import torch
from torch import Tensor

SECTORS = 16
STOPPED = 1e-6
"""Factor on the rates of a front that is held: no fire crosses a cell within a forecast."""


def sectors_about(known: Tensor) -> Tensor:
    """Return the sector of each cell about the middle of some cells, int64 [H, W]; they may be none."""
    height, width = known.shape
    places = known.nonzero().to(torch.float32)
    row, column = places.mean(0) if len(places) else torch.tensor([height / 2.0, width / 2.0])
    south = torch.arange(height, device=known.device)[:, None] - row
    east = torch.arange(width, device=known.device) - column
    turn = torch.atan2(south, east) / (2.0 * math.pi) + 0.5
    return (turn * SECTORS).to(torch.int64).clamp(0, SECTORS - 1)


def by_sector(values: Tensor, where: Tensor) -> Tensor:
    """Return the sums of planes [K, H, W] in each sector, float32 [K, S]."""
    sums = torch.zeros(len(values), SECTORS, device=values.device)
    return sums.index_add_(1, where.flatten(), values.flatten(1).to(torch.float32))
