"""Where a team starts."""

import torch
from torch import Tensor

from warp_torchrl.world.fast.constants import whole_numbers
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import Cover


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
    rows = torch.arange(height, device=cover.device)
    columns = torch.arange(width, device=cover.device)
    corner = (uniform(key, 0, Stream.START, (2,)) < 0.5).to(torch.int64)
    base = corner * whole_numbers((height - 1, width - 1), cover.device)
    if start == "corner":
        row_distance = (rows - base[:, :1]).abs()[:, :, None]
        column_distance = (columns - base[:, 1:]).abs()[:, None, :]
        order = torch.maximum(row_distance, column_distance) * (height + width) + row_distance + column_distance
    else:
        order = (uniform(key, 1, Stream.START, (height, width)) * (1 << 24)).to(torch.int64)
    cell = torch.arange(height * width, device=cover.device)
    rank = (order + taken * (1 << 30)).flatten(1) * (height * width) + cell
    best = rank.topk(n_agents, dim=1, largest=False, sorted=True).indices
    return base, torch.stack((best // width, best % width), dim=-1)
