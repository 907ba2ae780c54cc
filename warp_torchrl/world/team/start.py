"""Start of a team."""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.constants import whole_numbers
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.state import Cover


def starting_cells(key: Tensor, cover: Tensor, burning: Tensor, n_agents: int, start: str) -> tuple[Tensor, Tensor]:
    """Return the corner drawn for each episode and the cells that the agents start from.

    Each agent takes the free cell (neither lake nor lit) nearest to the corner, no two the same one; or, where they
    start ``anywhere``, free cells drawn over the map.

    Args:
        key: World keys, int64 [B].
        cover: Land cover, uint8 [B, H, W].
        burning: Cells on fire, bool [B, H, W].
        n_agents: A.
        start: ``corner`` or ``anywhere``.

    Returns:
        The corner's (row, column), int64 [B, 2], and the agents', int64 [B, A, 2] [cells].
    """
    height, width = cover.shape[1:]
    taken = (cover == int(Cover.LAKE)) | burning
    corner = (uniform(key, 0, Stream.START, (2,)) < 0.5).to(torch.int64)
    base = corner * whole_numbers((height - 1, width - 1), cover.device)
    if start == "corner":
        return base, nearest_free(taken, base, n_agents)
    order = (uniform(key, 1, Stream.START, (height, width)) * (1 << 24)).to(torch.int64)
    return base, first_free(order, taken, n_agents)


def nearest_free(taken: Tensor, base: Tensor, n_agents: int) -> Tensor:
    """Return the free cells nearest to a corner.

    Args:
        taken: bool [B, H, W].
        base: The corner's (row, column), int64 [B, 2] [cells].
        n_agents: A.

    Returns:
        (row, column), int64 [B, A, 2] [cells].
    """
    height, width = taken.shape[1:]
    side = 2 * n_agents
    if side < min(height, width) and needs_no_sync(taken.device):  # most are in a small square, ten times faster
        near = torch.where(base[:, None] == 0, 0, base[:, None] - side + 1)
        cells = torch.arange(side, device=taken.device)
        rows, columns = near[..., 0] + cells, near[..., 1] + cells
        index = (rows[:, :, None] * width + columns[:, None, :]).flatten(1)
        square = taken.flatten(1).gather(1, index).view(-1, side, side)
        if ((~square).flatten(1).sum(dim=1) >= n_agents).all():
            return first_free(distances_to(base - near[:, 0], side, side), square, n_agents) + near
    return first_free(distances_to(base, height, width), taken, n_agents)


def distances_to(base: Tensor, height: int, width: int) -> Tensor:
    """Return numbers in the order of the cells' distances to a cell, int64 [B, 2], int64 [B, H, W].

    The longer way counts first, then the sum.
    """
    row = (torch.arange(height, device=base.device) - base[:, :1]).abs()[:, :, None]
    column = (torch.arange(width, device=base.device) - base[:, 1:]).abs()[:, None, :]
    return torch.maximum(row, column) * (height + width) + row + column


def first_free(order: Tensor, taken: Tensor, n_agents: int) -> Tensor:
    """Return the free cells of the lowest order, the earlier ones among equals, int64 [B, A, 2] [cells].

    Args:
        order: int64 [B, H, W], below 2^30.
        taken: bool [B, H, W].
        n_agents: A.
    """
    height, width = taken.shape[1:]
    cell = torch.arange(height * width, device=taken.device)
    rank = (order + taken * (1 << 30)).flatten(1) * (height * width) + cell
    best = rank.topk(n_agents, dim=1, largest=False, sorted=True).indices
    return torch.stack((best // width, best % width), dim=-1)
