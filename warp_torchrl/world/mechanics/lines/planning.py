"""Plans of work: the fires that vehicles can work at, and the steps that a line takes."""

from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.listing import flat_cells, in_all
from warp_torchrl.world.law.flames import weakest_way_out
from warp_torchrl.world.mechanics.lines.production import metres_a_minute
from warp_torchrl.world.mechanics.lines.tasks import AIRCRAFT, DONE, Lines, Pace
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Cover, WorldState

MANY = 1e6
"""Steps to clear what cannot be cleared."""


def open_fire(state: WorldState, heat: Tensor, limit: float) -> Tensor:
    """Return the burning cells that an agent can work at from a neighbour without fire or lake, bool [B, H, W].

    Args:
        state: The worlds.
        heat: Of an area that burns, float32 [B, H, W] [kJ/m2].
        limit: Intensity of the front towards the agent, at most [kW/m].
    """
    burns = is_burning(state.cells)
    cell = flat_cells(burns)
    able = burns.flatten().index_select(0, cell) & (_weakest(state, heat, cell) <= limit)
    return torch.zeros_like(burns).flatten().scatter_(0, cell, able).view_as(burns)


def _weakest(state: WorldState, heat: Tensor, cell: Tensor) -> Tensor:
    """Return the intensity of the front of some cells, int64 [N], to the neighbour where it is weakest, float32 [N]."""
    stands = ~(is_burning(state.cells) | (state.cover == int(Cover.LAKE)))
    return weakest_way_out(state, heat, stands, cell)


def steps_alone(state: WorldState, cells: Tensor, pace: Pace) -> Tensor:
    """Return the steps that each agent alone takes to put out fires, float32 [B, A, K]; inf at flames over its limit.

    It works from the neighbour towards which the front is weakest.

    Args:
        state: The worlds.
        cells: Flat indices, int64 [B, K].
        pace: Of the work.
    """
    lines = state.planes("lines", Lines)
    alike = torch.full_like(cells, pace.alike, dtype=torch.float32)
    strong = alike
    if lines.heat is not None:
        every = in_all(cells, state.cells[0].numel())
        strong = _weakest(state, lines.heat, every.flatten()).view_as(alike)
    minutes = strong * (pace.seconds * state.ground.cell_size / 60.0)
    steps = (minutes / lines.minutes).clamp(min=1.0)[:, None]
    limit = numbers(pace.strongest, cells.device)[lines.means]
    steps = torch.where((lines.means == AIRCRAFT)[..., None], 1.0, steps)
    return torch.where(strong[:, None] <= limit[..., None], steps, torch.inf)


def steps_left(state: WorldState, builders: Sequence[int], gain: float) -> Tensor:
    """Return how many steps of one agent the line of each cell still takes, float32 [B, H, W]; at most ``MANY``.

    Args:
        state: The worlds.
        builders: Index of each agent's means; the mean of their rates holds.
        gain: Factor on the rates.
    """
    lines = state.planes("lines", Lines)
    zero = torch.zeros_like(lines.kind, dtype=torch.int64)
    rates = [builders.count(each) * metres_a_minute(lines.kind, zero + each) for each in dict.fromkeys(builders)]
    step = torch.stack(rates).sum(dim=0) * (gain * lines.minutes / len(builders))
    left = (1.0 - lines.work.clamp(min=0) / DONE) * state.ground.cell_size
    return torch.where(step > 0.0, (left / step.clamp(min=1e-9)).ceil(), MANY).clamp(1.0, MANY)
