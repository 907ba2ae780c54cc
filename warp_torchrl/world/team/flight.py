"""What aircraft are bound by, where a team's options say so: distance to each other, batteries, and the wind."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.state import Vehicles, WorldState

AT_BASE = 1
"""Chebyshev distance from the base within which batteries are charged: strides of two cells may pass the base by."""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The rules of flight of a team's aircraft.

    Attributes:
        separation: Aircraft that end a step nearer to each other than this, by Euclidean distance [cells], have a near
            miss each; None counts none. Swarms that watch wildfires, as those of Ali, Ali and Baig (2023), must keep
            apart.
        battery: Steps of flight of an aircraft, hovering too, charged at the corner where the team started; with an
            empty battery it stays where it is. None is unlimited.
        drift: Chance a step for each m/s of the wind at its cell that an aircraft is carried one cell downwind [s/m].

    Raises:
        ValueError: If a value is out of its range.
    """

    separation: float | None = None
    battery: int | None = None
    drift: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, separation=(0.0, 1e6), battery=(1, 1_000_000), drift=(0.0, 1.0))

    def near_misses(self, vehicles: Vehicles, flies: Tensor, running: Tensor) -> Tensor | None:
        """Return the near misses of each agent after the moves of a step, int32 [B, A]; None where none are counted.

        An aircraft has one if it ends the step nearer to another aircraft than ``separation``.

        Args:
            vehicles: The team after its moves, with the near misses before the step.
            flies: Which agents fly, bool [A].
            running: Which worlds go on, bool [B, 1].
        """
        if self.separation is None or vehicles.near_misses is None:
            return vehicles.near_misses
        position = vehicles.position.to(torch.float32)
        apart = (position[:, :, None] - position[:, None]).square().sum(-1)
        others = ~torch.eye(len(flies), dtype=torch.bool, device=flies.device)
        near = ((apart < self.separation**2) & flies[:, None] & flies & others).any(dim=-1)
        return vehicles.near_misses + (near & running).to(torch.int32)

    def batteries(self, vehicles: Vehicles, flies: Tensor, running: Tensor) -> Tensor | None:
        """Return the steps of flight that are left after a step, int32 [B, A]; None where batteries do not run down.

        A step in the air takes one, also one without a move; at the base a battery is full again.

        Args:
            vehicles: The team after its moves, with the batteries before the step.
            flies: Which agents fly, bool [A]; the others keep theirs.
            running: Which worlds go on, bool [B, 1].
        """
        if self.battery is None or vehicles.battery is None:
            return vehicles.battery
        at_base = (vehicles.position - vehicles.base[:, None]).abs().amax(dim=-1) <= AT_BASE
        left = torch.where(at_base, self.battery, (vehicles.battery - 1).clamp(min=0))
        return torch.where(running & flies, left, vehicles.battery)

    def drifted(self, state: WorldState, flies: Tensor, running: Tensor) -> WorldState:
        """Return the worlds after the wind has carried each aircraft one cell, or not at all.

        It does with chance min(1, drift x speed), towards that of the eight neighbours which is nearest to downwind,
        and nobody over the map's edge.

        Args:
            state: The worlds after the moves.
            flies: Which agents fly, bool [A]; those with an empty battery are on the ground.
            running: Which worlds go on, bool [B, 1].
        """
        if self.drift == 0.0:
            return state
        position, (height, width) = state.vehicles.position, state.cells.shape[1:]
        east, north = wind_at(state).unbind(-1)
        chance = self.drift * torch.hypot(east, north)
        turn = (torch.atan2(east, north) / (math.pi / 4.0)).round().to(torch.int64) % 8
        step = offsets(position.device)[turn]
        row, column = (position + step).unbind(-1)
        on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        gust = uniform(state.key, state.step, Stream.DRIFT, (position.shape[1],)) < chance
        flying = running & flies & ~grounded(state.vehicles, flies)
        position = position + step * (gust & on_map & flying)[..., None]
        return state.replace(vehicles=state.vehicles.replace(position=position))


def grounded(vehicles: Vehicles, flies: Tensor) -> Tensor:
    """Return which agents stay where they are: aircraft, bool [A], with an empty battery; bool [B, A] or [A]."""
    return torch.zeros_like(flies) if vehicles.battery is None else flies & (vehicles.battery == 0)


def wind_at(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, float32 [B, A, 2], (u east, v north) [m/s]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        return wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    index = position[..., 0] * wind.shape[3] + position[..., 1]
    return wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
