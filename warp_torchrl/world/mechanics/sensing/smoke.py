"""Smoke that drifts downwind and hides fire. The law is of our own making, and no model of a source."""

import torch
from torch import Tensor

from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState


def smoke(state: WorldState, length: int) -> Tensor:
    """Return the smoke at each cell, float32 [B, H, W]: sum over k = 0..length of burning(k cells upwind) / (1 + k).

    The wind is the map's mean, and upwind one of the cells nearest to its line; in calm air smoke stays where it is.

    Args:
        state: The worlds.
        length: How far smoke drifts [cells].
    """
    return drifted(is_burning(state.cells), state.wind, length)


def sources(hidden: Tensor, wind: Tensor, length: int) -> Tensor:
    """Return how much points to smoke that comes from each cell, float32 [B, H, W] in 0..1.

    The sum over k = 0..length of hidden(k cells downwind) / (1 + k), 1 at the most.

    Args:
        hidden: Cells that smoke hides, bool [B, H, W].
        wind: Wind, float32 [B, 2, h, w].
        length: How far smoke drifts [cells].
    """
    return drifted(hidden, -wind, length).clamp(max=1.0)


def drifted(marked: Tensor, wind: Tensor, length: int) -> Tensor:
    """Return the sum over k = 0..length of marked(k cells upwind) / (1 + k), float32 [B, H, W].

    Args:
        marked: What each cell gives off, bool or float32 [B, H, W].
        wind: Wind, float32 [B, 2, h, w].
        length: How far it drifts [cells].
    """
    height, width = marked.shape[1:]
    east, north = wind.mean(dim=(2, 3)).unbind(1)
    speed = (east.square() + north.square()).sqrt()
    way = torch.stack((-north, east), dim=-1) / speed.clamp(min=1e-6)[:, None]  # rows grow south
    steps = torch.arange(length + 1, device=speed.device)
    back = (way[:, None] * steps[:, None]).round().to(torch.int64)  # [B, K, 2]
    row = torch.arange(height, device=speed.device) - back[..., 0, None]
    column = torch.arange(width, device=speed.device) - back[..., 1, None]
    on_map = ((row >= 0) & (row < height))[..., :, None] & ((column >= 0) & (column < width))[..., None, :]
    index = row.clamp(0, height - 1)[..., :, None] * width + column.clamp(0, width - 1)[..., None, :]
    gives = marked.to(torch.float32).flatten(1)
    upwind = gives.gather(1, index.flatten(1)).view_as(index) * on_map
    weight = 1.0 / (1.0 + steps)
    drifts = (speed > 1e-6)[:, None] | (steps == 0)
    return (upwind * (weight * drifts)[..., None, None]).sum(dim=1)
