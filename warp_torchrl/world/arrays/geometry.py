"""The grid's directions and distances.

Rows grow south and columns grow east. Direction 0 is north; the eight directions go round clockwise, so
direction ``d`` and ``(d + 4) % 8`` are opposite.
"""

import math

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.system.modes import kept

DIRECTIONS = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
"""(row, column) offset of N, NE, E, SE, S, SW, W, NW [cells]."""

DISTANCES = tuple(math.hypot(row, column) for row, column in DIRECTIONS)
"""Distance to the neighbour in each direction [cells]: 1 along the axes, sqrt(2) along the diagonals."""

_STEPS = 4
"""Steps of a walk between two looks at whether it has ended."""


@kept(8)
def offsets(device: torch.device) -> Tensor:
    """Return the (row, column) offset of each direction, int64 [N, 2], kept for the next time [cells]."""
    return torch.tensor(DIRECTIONS, device=device)


def unit_vectors(device: torch.device | str = "cpu") -> Tensor:
    """Return the unit vector (east, north) of each direction, float32 [N, 2]."""
    rows = [(column / length, -row / length) for (row, column), length in zip(DIRECTIONS, DISTANCES, strict=True)]
    return torch.tensor(rows, device=device)


def neighbour_in(direction: int, plane: Tensor) -> Tensor:
    """Return what each cell's neighbour in a direction holds, [B, H, W]; 0 beyond the map."""
    row, column = DIRECTIONS[direction]
    height, width = plane.shape[-2:]
    return pad(plane, (1, 1, 1, 1))[..., 1 + row : 1 + row + height, 1 + column : 1 + column + width]


def neighbours(plane: Tensor, beyond: float) -> Tensor:
    """Return what each cell's neighbours hold, [8, B, H, W]; a number beyond the map."""
    return torch.stack(slices(pad(plane, (1, 1, 1, 1), value=beyond)))


def slices(padded: Tensor) -> list[Tensor]:
    """Return the neighbour in each direction of the cells of maps with a margin of one, [B, H, W] each; views."""
    height, width = padded.shape[-2] - 2, padded.shape[-1] - 2
    return [padded[..., 1 + row : 1 + row + height, 1 + column : 1 + column + width] for row, column in DIRECTIONS]


def places_around(cell: Tensor, size: tuple[int, int]) -> Tensor:
    """Return where the neighbours of cells lie in maps with a margin of one cell, flat indices in all, int64 [8, N].

    Args:
        cell: Flat indices in maps [B, H, W], int64 [N].
        size: (H, W).
    """
    height, width = size
    line, column = cell.div(width, rounding_mode="floor"), cell % width
    margins = 2 * line.div(height, rounding_mode="floor") + 1  # lines of margins before it
    return _steps(width, cell.device) + (line + margins) * (width + 2) + column + 1


@kept(32)
def _steps(width: int, device: torch.device) -> Tensor:
    """Return how far each neighbour lies along maps of a width with a margin of one cell, int64 [8, 1]."""
    return torch.tensor([[down * (width + 2) + right] for down, right in DIRECTIONS], device=device)


def grow(mask: Tensor, radius: int = 1) -> Tensor:
    """Return the cells within a Chebyshev distance ``radius`` of a marked cell, bool [..., H, W]."""
    for _ in range(radius):
        rows = mask.clone()
        rows[..., 1:, :] |= mask[..., :-1, :]
        rows[..., :-1, :] |= mask[..., 1:, :]
        mask = rows.clone()
        mask[..., 1:] |= rows[..., :-1]
        mask[..., :-1] |= rows[..., 1:]
    return mask


def flood(seeds: Tensor, open_cells: Tensor) -> Tensor:
    """Return the open cells that are reached from the seeds over open cells, eight neighbours each.

    The walk is followed for 2 (H + W) steps: only a labyrinth holds longer shortest paths. Where reading a
    result needs no synchronisation, it ends as soon as nothing new is reached.

    Args:
        seeds: bool [B, H, W]; a seed need not be open.
        open_cells: bool [B, H, W].

    Returns:
        bool [B, H, W].
    """
    reached, reads = seeds, needs_no_sync(seeds.device)
    passable = open_cells | seeds
    for step in range(1, 2 * sum(seeds.shape[-2:]) + 1):
        before, reached = reached, grow(reached) & passable
        if reads and step % _STEPS == 0 and torch.equal(before, reached):
            break
    return reached & open_cells
