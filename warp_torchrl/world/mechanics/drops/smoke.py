"""Smoke over aircraft."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.squares import clamped
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
    wind = state.wind[:, :, 0, 0] if state.wind.shape[2:] == (1, 1) else state.wind.mean(dim=(2, 3))
    east, north = wind.unbind(1)
    speed = torch.sqrt(east * east + north * north)[:, None]
    way = torch.stack((-north, east), dim=-1) / speed.clamp(min=1e-6)  # rows grow south
    far = numbers(tuple(range(length + 1)), wind.device)
    upwind = state.vehicles.position[..., None] - (way[:, None, :, None] * far).round().to(torch.int64)
    place, is_on_map = clamped(upwind, state.cells.shape[1:])
    row, column = place.unbind(-2)
    cell = torch.add(column, row, alpha=state.cells.shape[2])
    has_row, has_column = is_on_map.unbind(-2)
    burns = is_burning(at_cells(state.cells, cell.flatten(1))).view_as(cell) & has_row & has_column
    weight = (1.0 / (1.0 + far)) * ((speed > 1e-6) | (far == 0.0))
    return (burns * weight[:, None]).sum(dim=-1)
