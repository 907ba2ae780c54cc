"""Worth of cells, and sums over parts of the map."""

import torch
from torch import Tensor

from warp_torchrl.world.state.state import WorldState


def worth_of(state: WorldState) -> Tensor:
    """Return what each cell is worth, float32 [B, H, W]: the landscape's assets, or 1."""
    assets = state.landscape.layer("assets")
    return torch.ones_like(state.alpha) if assets is None else assets


def sums_by(part: Tensor, plane: Tensor, count: int) -> Tensor:
    """Return the sums of a plane, float32 [B, H, W], over each part of the map, float32 [B, K].

    Args:
        part: Which part each cell is of, uint8 [B, H, W].
        plane: What is summed.
        count: K.
    """
    parts = torch.arange(count, device=part.device)[:, None, None]
    return torch.where(part[:, None] == parts, plane[:, None], 0.0).sum(dim=(2, 3))
