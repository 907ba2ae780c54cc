"""Plans of work: the fires that vehicles can work at, and the steps that a line takes."""

from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.world.arrays.geometry import neighbours
from warp_torchrl.world.law.flames import weakest_way_out
from warp_torchrl.world.mechanics.lines.production import metres_a_minute
from warp_torchrl.world.mechanics.lines.tasks import DONE, Lines
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
    stands = ~(burns | (state.cover == int(Cover.LAKE)))
    return burns & (weakest_way_out(state, heat, neighbours(stands.to(torch.uint8), 0) > 0) <= limit)


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
