"""Smoke over aircraft."""

import torch
from torch import Tensor

from warp_torchrl.world.law.automaton import at_cells
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState


def smoke_at(state: WorldState, length: int) -> Tensor:
    """Return the smoke over each agent, float32 [B, A]: the sum over k of burning(k cells upwind) / (1 + k).

    The wind is the map's mean; in calm air smoke stays where it is. The law is ours.

    Args:
        state: The worlds.
        length: How far smoke drifts [cells].
    """
    (height, width), position = state.cells.shape[1:], state.vehicles.position
    east, north = state.wind.mean(dim=(2, 3)).unbind(1)
    speed = torch.sqrt(east * east + north * north)
    way = torch.stack((-north, east), dim=-1) / speed.clamp(min=1e-6)[:, None]  # rows grow south
    far = torch.arange(length + 1, device=position.device)
    upwind = position[:, :, None] - (way[:, None, None] * far[:, None]).round().to(torch.int64)
    row, column = upwind.unbind(-1)
    drifts = (speed > 1e-6)[:, None, None] | (far == 0)
    on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width) & drifts
    cell = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
    burns = is_burning(at_cells(state.cells, cell.flatten(1))).view_as(cell) & on_map
    return (burns / (1.0 + far)).sum(dim=-1)
