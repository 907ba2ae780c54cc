"""What aircraft are bound by, where a scenario says so: distance to each other, batteries, and the wind."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.role import RoleTable
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.places import wind_at
from warp_torchrl.world.team.presence import those_there

AT_BASE = 1
"""Chebyshev distance from the base within which batteries are charged: strides of two cells may pass the base by."""


@dataclass(eq=False, repr=False)
class Aircraft(Batch):
    """What is counted of each agent in the air."""

    near_misses: Tensor | None  # int32 [B,A], steps that ended too near another aircraft; None: not counted
    battery: Tensor | None  # int32 [B,A], steps of flight left; None where they are not counted


@mechanic("flight")
@dataclass(frozen=True, kw_only=True)
class Flight(Mechanic):
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

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds whose aircraft have full batteries and no near misses."""
        zero = torch.zeros_like(state.vehicles.acts)
        aircraft = Aircraft(
            near_misses=None if self.separation is None else zero,
            battery=None if self.battery is None else torch.full_like(zero, self.battery),
        )
        return state.with_planes(self.name, aircraft)

    def grounded(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which aircraft have an empty battery, bool [B, A]; None where batteries do not run down."""
        battery = state.planes(self.name, Aircraft).battery
        return None if battery is None else roles.flies & (battery == 0)

    def moved(self, state: WorldState, roles: RoleTable, running: Tensor) -> WorldState:
        """Return worlds in which the wind has carried aircraft, and what follows from where they are is counted."""
        running, flies = running[:, None], those_there(state, roles.flies)
        state = self._drifted(state, roles, running & flies)
        aircraft = state.planes(self.name, Aircraft)
        return state.with_planes(
            self.name,
            Aircraft(
                near_misses=self._near_misses(state, aircraft.near_misses, flies, running),
                battery=self._batteries(state, aircraft.battery, flies, running),
            ),
        )

    def due_at_base(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which aircraft have charge for the way to the base and two steps, or less, bool [B, A].

        None where batteries do not run down.
        """
        vehicles, battery = state.vehicles, state.planes(self.name, Aircraft).battery
        if battery is None:
            return None
        away = (vehicles.position - vehicles.base[:, None]).abs().amax(dim=-1)
        return roles.flies & (battery <= away / roles.stride + 2.0)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``near_misses`` where they are counted."""
        return () if self.separation is None else (Metric("near_misses", "less", title="near misses"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``near_misses``, those at the ends of steps, a share of the agents' steps."""
        misses = state.planes(self.name, Aircraft).near_misses
        if misses is None:
            return {}
        return {"near_misses": misses.sum(1) / (state.step * misses.shape[1]).clamp(min=1)}

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``battery`` where it runs down."""
        return () if self.battery is None else ("battery",)

    def status(self, state: WorldState) -> Tensor:
        """Return the share of its charge that each agent has left, float32 [B, A, 1]."""
        battery = state.planes(self.name, Aircraft).battery
        if battery is None or self.battery is None:
            raise ValueError("worlds must have batteries that run down: mechanics.flight.battery")
        return (battery / self.battery)[..., None]

    def _near_misses(self, state: WorldState, misses: Tensor | None, flies: Tensor, running: Tensor) -> Tensor | None:
        """Return the near misses of each agent after the moves of a step, int32 [B, A]; None where none are counted.

        An aircraft has one if it ends the step nearer to another aircraft than ``separation``.

        Args:
            state: The worlds after the moves.
            misses: Those before the step.
            flies: Which agents fly, bool [A] or [B, A].
            running: Which worlds go on, bool [B, 1].
        """
        if self.separation is None or misses is None:
            return misses
        position = state.vehicles.position.to(torch.float32)
        apart = (position[:, :, None] - position[:, None]).square().sum(-1)
        others = ~torch.eye(flies.shape[-1], dtype=torch.bool, device=flies.device)
        near = ((apart < self.separation**2) & flies[..., None] & flies[..., None, :] & others).any(dim=-1)
        return misses + (near & running).to(torch.int32)

    def _batteries(self, state: WorldState, battery: Tensor | None, flies: Tensor, running: Tensor) -> Tensor | None:
        """Return the steps of flight that are left after a step, int32 [B, A]; None where batteries do not run down.

        A step in the air takes one, also one without a move; at the base a battery is full again.

        Args:
            state: The worlds after the moves.
            battery: Those before the step.
            flies: Which agents fly, bool [A] or [B, A]; the others keep theirs.
            running: Which worlds go on, bool [B, 1].
        """
        if self.battery is None or battery is None:
            return battery
        vehicles = state.vehicles
        at_base = (vehicles.position - vehicles.base[:, None]).abs().amax(dim=-1) <= AT_BASE
        left = torch.where(at_base, self.battery, (battery - 1).clamp(min=0))
        return torch.where(running & flies, left, battery)

    def _drifted(self, state: WorldState, roles: RoleTable, flies: Tensor) -> WorldState:
        """Return the worlds after the wind has carried each aircraft one cell, or not at all.

        It does with chance min(1, drift x speed), towards that of the eight neighbours which is nearest to downwind,
        and nobody over the map's edge.

        Args:
            state: The worlds after the moves.
            roles: Of the agents; aircraft with an empty battery are on the ground.
            flies: Which agents fly in worlds that go on, bool [B, A].
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
        grounded = self.grounded(state, roles)
        flying = flies if grounded is None else flies & ~grounded
        position = position + step * (gust & on_map & flying)[..., None]
        return state.replace(vehicles=state.vehicles.replace(position=position))
