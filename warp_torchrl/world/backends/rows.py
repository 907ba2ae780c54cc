"""How fire passes from burning cells to their neighbours: the sum of the eight directions at every cell.

The maps of a batch lie in one row (``row_layout``), so that the neighbours of all cells in a direction are one
contiguous slice at a constant offset.
"""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.bytes import byte, number, to_uint8
from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.arrays.row_layout import in_a_row
from warp_torchrl.world.backends.join import Joining

Shape = tuple[int, ...]


def probability_from_rows(
    law: Joining, spreading: Tensor, susceptible: Tensor, gain: Tensor, slope: Tensor | None, directions: range
) -> Tensor:
    """Return each cell's chance to be ignited by its neighbours in one tick.

    Args:
        law: What makes chances of strengths.
        spreading: The burning cells that ignite others, bool [B, H, W].
        susceptible: The ground's part of a strength, 0 where nothing can ignite, float32 [B, H, W].
        gain: w_d / distance_d at the source, float32 [B, 8, 1, 1] or [B, 8, H, W].
        slope: The slope's factor into the target, float32 [B, 8, H + 2, W + 1], see ``wind_and_slope.slope_factor``;
            None where the world is flat.
        directions: Those in which fire travels.

    Returns:
        float32 [B, H, W].
    """
    shape, burning = tuple(susceptible.shape), number(spreading)
    rows = [in_a_row(to_uint8(byte(spreading)) if is_fused() else burning)]
    if gain.shape[2:] != (1, 1):
        rows = [in_a_row(burning * gain[:, direction]) for direction in range(8)]
        gain = torch.ones_like(gain[..., :1, :1])
    target = susceptible if is_fused() else _shifted(in_a_row(susceptible), shape, 0)
    total, strength, spare = torch.zeros_like(target), torch.empty_like(target), torch.empty_like(target)
    for direction in directions:
        source = _shifted(rows[direction % len(rows)], shape, -_offset(direction, shape)).to(torch.float32)
        torch.mul(source, gain[:, direction], out=strength)
        strength.mul_(target)
        if slope is not None:
            strength *= _slope(slope, direction, shape, 0)
        law.join(total, strength, spare)
    chance = law.probability(total)
    return chance if is_fused() else _on_map(chance).contiguous()


def expected_from_rows(
    law: Joining, susceptible: Tensor, gain: Tensor, slope: Tensor | None, directions: range
) -> Tensor:
    """Return how many neighbours each cell would be expected to ignite in a tick if it burned.

    Args:
        law: As of ``probability_from_rows``, and so are the others.
        susceptible: float32 [B, H, W].
        gain: float32 [B, 8, 1, 1] or [B, 8, H, W].
        slope: float32 [B, 8, H + 2, W + 1] or None.
        directions: Those in which fire travels.

    Returns:
        float32 [B, H, W].
    """
    shape = tuple(susceptible.shape)
    if gain.shape[2:] != (1, 1) and not is_fused():
        gain = pad(gain, (0, 1, 0, 1))
    row = in_a_row(susceptible)
    total = torch.zeros_like(_shifted(row, shape, 0))
    strength = torch.empty_like(total)
    for direction in directions:
        offset = _offset(direction, shape)
        torch.mul(_shifted(row, shape, offset), gain[:, direction], out=strength)
        if slope is not None:
            strength *= _slope(slope, direction, shape, offset)
        total += law.probability_of(strength)
    return total if is_fused() else _on_map(total)


def _offset(direction: int, shape: Shape) -> int:
    """Return how far along the row the next cell in a direction is."""
    row, column = DIRECTIONS[direction]
    return row * (shape[2] + 1) + column


def _shifted(row: Tensor, shape: Shape, offset: int) -> Tensor:
    """Return what a row holds so far along from each cell: of maps with their margins, [B, H + 1, W + 1].

    They lie one after the other without a gap, which is fast; a function that is fused reads the maps alone, [B, H, W].
    """
    start, cells = shape[2] + 2 + offset, shape[0] * (shape[1] + 1) * (shape[2] + 1)
    return _maps(row[start : start + cells], shape)


def _slope(slope: Tensor, direction: int, shape: Shape, offset: int) -> Tensor:
    """Return the slope's factor into the cell so far along from each cell, as ``_shifted`` does."""
    _, height, width = shape
    first = (direction * (height + 2) + 1) * (width + 1) + offset
    return _maps(slope.flatten(1)[:, first : first + (height + 1) * (width + 1)], shape)


def _maps(row: Tensor, shape: Shape) -> Tensor:
    maps = row.view(shape[0], shape[1] + 1, shape[2] + 1)
    return _on_map(maps) if is_fused() else maps


def _on_map(maps: Tensor) -> Tensor:
    """Return maps [B, H, W] without the margin after them."""
    return maps[:, :-1, :-1]
