"""What aircraft are bound by, where a team's options say so: distance to each other, batteries, and the wind."""

import math

import torch
from torch import Tensor

from warp_torchrl.world.geometry import offsets
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import Vehicles, WorldState

AT_BASE = 1
"""Chebyshev distance from the base within which batteries are charged: strides of two cells may pass the base by."""


def near_misses(vehicles: Vehicles, flies: Tensor, separation: float | None, running: Tensor) -> Tensor | None:
    """Return the near misses of each agent after the moves of a step, int32 [B, A]; None where they are not counted.

    An aircraft has one if it ends the step nearer to another aircraft than ``separation``, by Euclidean distance.

    Args:
        vehicles: The team after its moves, with the near misses before the step.
        flies: Which agents fly, bool [A].
        separation: See ``Team`` [cells].
        running: Which worlds go on, bool [B, 1].
    """
    if separation is None or vehicles.near_misses is None:
        return vehicles.near_misses
    position = vehicles.position.to(torch.float32)
    apart = (position[:, :, None] - position[:, None]).square().sum(-1)
    others = ~torch.eye(len(flies), dtype=torch.bool, device=flies.device)
    near = ((apart < separation**2) & flies[:, None] & flies & others).any(dim=-1)
    return vehicles.near_misses + (near & running).to(torch.int32)


def batteries(vehicles: Vehicles, flies: Tensor, capacity: int | None, running: Tensor) -> Tensor | None:
    """Return the steps of flight that are left after a step, int32 [B, A]; None where batteries do not run down.

    A step in the air takes one, also one without a move; at the base a battery is full again.

    Args:
        vehicles: The team after its moves, with the batteries before the step.
        flies: Which agents fly, bool [A]; the others keep theirs.
        capacity: Steps of flight of a full battery.
        running: Which worlds go on, bool [B, 1].
    """
    if capacity is None or vehicles.battery is None:
        return vehicles.battery
    at_base = (vehicles.position - vehicles.base[:, None]).abs().amax(dim=-1) <= AT_BASE
    left = torch.where(at_base, capacity, (vehicles.battery - 1).clamp(min=0))
    return torch.where(running & flies, left, vehicles.battery)


def grounded(vehicles: Vehicles, flies: Tensor) -> Tensor:
    """Return which agents stay where they are: aircraft, bool [A], with an empty battery; bool [B, A] or [A]."""
    return torch.zeros_like(flies) if vehicles.battery is None else flies & (vehicles.battery == 0)


def carried(state: WorldState, flying: Tensor, drift: float) -> Tensor:
    """Return by how much the wind carries each agent in a step, int64 [B, A, 2]: one cell, or not at all [cells].

    It does with chance min(1, drift x speed), towards that of the eight neighbours which is nearest to downwind, and
    nobody over the map's edge.

    Args:
        state: The worlds after the moves.
        flying: Which agents are in the air, bool [B, A].
        drift: See ``Team`` [s/m].
    """
    position, (height, width) = state.vehicles.position, state.cells.shape[1:]
    east, north = wind_at(state).unbind(-1)
    chance = drift * torch.hypot(east, north)
    turn = (torch.atan2(east, north) / (math.pi / 4.0)).round().to(torch.int64) % 8
    step = offsets(position.device)[turn]
    row, column = (position + step).unbind(-1)
    on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    gust = uniform(state.key, state.step, Stream.DRIFT, (position.shape[1],)) < chance
    return step * (gust & on_map & flying)[..., None]


def wind_at(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, float32 [B, A, 2], (u east, v north) [m/s]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        return wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    index = position[..., 0] * wind.shape[3] + position[..., 1]
    return wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
