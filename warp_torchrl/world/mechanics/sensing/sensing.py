"""What agents know of the fire: all of it, or what they and those that they hear have seen."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.sensing.records import kinds, recorded
from warp_torchrl.world.mechanics.sensing.smoke import smoke
from warp_torchrl.world.mechanics.sensing.watching import (
    Memory,
    Watching,
    at_start,
    counted,
    newest_records,
    unwatched,
    watching_of,
)
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState
from warp_torchrl.world.team.team import Team

_EVERYWHERE = 1 << 20
"""A sight that no map limits [cells]."""


@dataclass(frozen=True, kw_only=True)
class Sensing(Mechanic, ABC):
    """What the world needs of a sensing component."""

    name: ClassVar[str] = "sensing"

    @property
    @abstractmethod
    def is_limited(self) -> bool:
        """Return whether something may burn that agents do not know of."""

    @abstractmethod
    def reach(self, team: Team) -> list[int]:
        """Return how far each agent sees [cells]."""

    @abstractmethod
    def knows_where(self, state: WorldState, team: Team) -> tuple[Tensor, Tensor]:
        """Return of which others each agent knows where they are, bool [B or 1, A, A], and what it takes for that.

        The places are int64 [B, A or 1, A, 2], (row, column) [cells]: [b, i, j] is where agent i takes agent j to be.
        """

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode with what the agents know then."""
        return self.begun(state, world.team)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step, with what the agents know then of those that go on, bool [B]."""
        return self.updated(after, world.team, running)

    @abstractmethod
    def begun(self, state: WorldState, team: Team) -> WorldState:
        """Return worlds at the start of an episode with what the agents know then."""

    @abstractmethod
    def updated(self, state: WorldState, team: Team, running: Tensor) -> WorldState:
        """Return worlds after a step, with what the agents know then of those that go on, bool [B]."""


@dataclass(frozen=True, kw_only=True)
class Full(Sensing):
    """Agents are shown the fire as it is, as far as their observation reaches."""

    @property
    def is_limited(self) -> bool:
        """Return that it is not."""
        return False

    def check(self, world: Rules) -> None:
        """Check that the radio sends no maps, of which agents know all.

        Raises:
            ValueError: If it does.
        """
        if world.team.radio.sends_maps:
            raise ValueError(
                "team.radio.carries must be none or graph where agents see all (sensing=full), "
                f"got {world.team.radio.carries}"
            )

    def reach(self, team: Team) -> list[int]:
        """Return more than any map is long [cells]."""
        return [_EVERYWHERE] * team.n_agents

    def knows_where(self, state: WorldState, team: Team) -> tuple[Tensor, Tensor]:
        """Return that each knows where all others are, bool [1, A, A], and where they are, int64 [B, 1, A, 2]."""
        others = ~torch.eye(team.n_agents, dtype=torch.bool, device=state.cells.device)[None]
        return others, state.vehicles.position[:, None]

    def begun(self, state: WorldState, team: Team) -> WorldState:
        """Return the worlds."""
        return state

    def updated(self, state: WorldState, team: Team, running: Tensor) -> WorldState:
        """Return the worlds."""
        return state


@dataclass(frozen=True, kw_only=True)
class Sight(Sensing):
    """Agents know of the fire what they saw themselves, and where they send maps what those know whom they hear.

    An agent sees the cells within its radius by Chebyshev distance. Through smoke it sees a cell with the chance
    exp(-smoke S), the law of Beer and Lambert, where S is the smoke at the cell: the burning cells upwind of it, each
    weighing 1 at the cell itself and 1 / (1 + k) from k cells away, up to ``smoke_length``.

    Attributes:
        radius: How far agents see [cells].
        radius_of: The same by role, where it is another.
        miss: Chance a step that a burning cell in sight is taken for the tree that it was.
        false_alarm: Chance a step that a tree in sight is taken for a young fire.
        smoke: Extinction by the smoke of one burning cell [1].
        smoke_length: How far smoke drifts [cells].
        recent: For how long the team watches a cell of the front that it saw burn [steps]; of metrics and rewards.

    Raises:
        ValueError: If a value is out of its range or a role is unknown.
    """

    radius: int = 3
    radius_of: Mapping[str, int] = field(default_factory=dict)
    miss: float = 0.0
    false_alarm: float = 0.0
    smoke: float = 0.0
    smoke_length: int = 6
    recent: int = 8

    def __post_init__(self) -> None:
        check_fields(
            self,
            radius=(0, 64),
            radius_of=(0, 64),
            miss=(0.0, 1.0),
            false_alarm=(0.0, 1.0),
            smoke=(0.0, 100.0),
            smoke_length=(1, 64),
            recent=(0, 1_000_000),
        )
        unknown = [role for role in self.radius_of if role not in ROLES]
        if unknown:
            raise ValueError(f"radius_of must name roles of {', '.join(ROLES)}, got {unknown[0]}")

    @property
    def is_limited(self) -> bool:
        """Return that it is."""
        return True

    def reach(self, team: Team) -> list[int]:
        """Return how far each agent sees [cells]."""
        return [self.radius_of.get(role, self.radius) for role in team.agent_roles]

    def knows_where(self, state: WorldState, team: Team) -> tuple[Tensor, Tensor]:
        """Return of which others each agent knows where they are, bool [B, A, A], and where, int64 [B, A, A, 2].

        It knows where those are that it sees, and where those were whose packets reach it, when they sent them.
        """
        sees, hears = others_in_sight(state, self.reach(team)), team.radio.arriving(state, _flies(state, team))
        here, then = state.vehicles.position[:, None], team.radio.places(state)[:, None]
        return hears | sees, torch.where(sees[..., None], here, then)

    def begun(self, state: WorldState, team: Team) -> WorldState:
        """Return the worlds with what the agents see where they start."""
        agents = state.vehicles.position.shape[1]
        before = state.landscape.age.to(torch.int32)[:, None].expand(-1, agents, -1, -1)
        blank = state.with_planes(self.name, Memory(records=before, watching=unwatched(state)))
        begun = self.updated(blank, team, torch.ones_like(state.done))
        memory = begun.planes(self.name, Memory)
        return begun.with_planes(self.name, memory.replace(watching=at_start(memory.watching)))

    def updated(self, state: WorldState, team: Team, running: Tensor) -> WorldState:
        """Return the worlds with what the agents see now, and are told."""
        memory, record = state.planes(self.name, Memory), recorded(self._taken_for(state), state.step)
        sees, known, watching = self._sees(state, team), memory.records, memory.watching
        knows, itself = torch.where(sees, record, known), watching.itself | sees
        if team.radio.sends_maps:
            state, told = team.radio.told(state, knows, _flies(state, team), running)
            itself = itself & (told <= knows)
            knows = torch.maximum(knows, told)
        goes_on = running[:, None, None, None]
        knows, itself = torch.where(goes_on, knows, known), torch.where(goes_on, itself, watching.itself)
        after = counted(state, watching, itself, newest_records(known, knows, itself, state.step), self.recent)
        return state.with_planes(self.name, Memory(records=knows, watching=_where(running, after, watching)))

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``watched``, ``found`` and ``uncertainty``."""
        return (Metric("watched", "more"), Metric("found", "more"), Metric("uncertainty", "less", unit="1"))

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return how well the team keeps the fire in sight.

        ``watched`` is the share of the front that it saw burn within the last ``recent`` steps, ``found`` that which it
        knows to burn, both means over the steps with a front. ``uncertainty`` is 1 - freshness of its newest records,
        mean over cells and steps.
        """
        watching = watching_of(state)
        fronts = watching.fronts.clamp(min=1)
        return {
            "watched": watching.watched / fronts,
            "found": watching.found / fronts,
            "uncertainty": watching.uncertainty / state.step.clamp(min=1),
        }

    def _sees(self, state: WorldState, team: Team) -> Tensor:
        """Return which cells each agent sees, bool [B, A, H, W]."""
        sees = in_reach(state, self.reach(team))
        if self.smoke == 0.0:
            return sees
        clear = torch.exp(-self.smoke * smoke(state, self.smoke_length))
        draws = uniform(state.key, state.step, Stream.SMOKE, tuple(sees.shape[1:]))
        return sees & (draws < clear[:, None])

    def _taken_for(self, state: WorldState) -> Tensor:
        """Return what each agent takes each cell for if it sees it, uint8 [B, 1 or A, H, W]."""
        kind = kinds(state)[:, None]
        if self.miss == 0.0 and self.false_alarm == 0.0:
            return kind
        agents = state.vehicles.position.shape[1]
        draws = uniform(state.key, state.step, Stream.SENSING, (agents, *state.cells.shape[1:]))
        burns, stands = is_burning(state.cells)[:, None], is_tree(state.cells)[:, None]
        taken = torch.where(burns & (draws < self.miss), state.age[:, None], kind)
        return torch.where(stands & (draws < self.false_alarm), FIRST_FIRE, taken)


def in_reach(state: WorldState, reach: list[int]) -> Tensor:
    """Return which cells are within each agent's reach by Chebyshev distance, bool [B, A, H, W].

    Args:
        state: The worlds.
        reach: Of each agent [cells].
    """
    height, width = state.cells.shape[1:]
    row, column = state.vehicles.position.unbind(-1)
    far = torch.tensor(reach, device=row.device)[:, None]
    on_row = (torch.arange(height, device=row.device) - row[..., None]).abs() <= far
    on_column = (torch.arange(width, device=row.device) - column[..., None]).abs() <= far
    return on_row[..., :, None] & on_column[..., None, :]


def _flies(state: WorldState, team: Team) -> Tensor:
    """Return which agents fly, bool [A]."""
    return team.table(state.cells.device).flies


def others_in_sight(state: WorldState, reach: list[int]) -> Tensor:
    """Return which others each agent sees, bool [B, A, A]: those within its reach by Chebyshev distance.

    Args:
        state: The worlds.
        reach: Of each agent [cells].
    """
    position = state.vehicles.position
    apart = (position[:, :, None] - position[:, None]).abs().amax(dim=-1)
    far = torch.tensor(reach, device=position.device)[:, None]
    return (apart <= far) & ~torch.eye(len(reach), dtype=torch.bool, device=position.device)


def _where(running: Tensor, after: Watching, before: Watching) -> Watching:
    """Return what was watched, after a step in the worlds that go on, bool [B], and else before it."""
    old = before.leaves()
    return after.with_leaves(
        {
            name: torch.where(running.view(-1, *[1] * (leaf.ndim - 1)), leaf, old[name])
            for name, leaf in after.leaves().items()
        }
    )
