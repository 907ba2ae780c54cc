"""What agents know of the fire: all of it, or what they and those that they hear have seen.

What an agent knows is a map of records, one a cell: what the cell was when it was last seen, and when that was,
``(1 + step) * 64 + 32 firebreak + 16 ash + code``. A cell that it never saw has the step -1 and the code that the map
showed before the fire. Of two records of a cell the larger is the newer one.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.role import ROLES
from warp_torchrl.world.state import FIRST_FIRE, Watching, WorldState, is_burning, is_tree
from warp_torchrl.world.team import Team
from warp_torchrl.world.watching import Records, at_start, counted, unwatched

_CODES, _ASH, _FIREBREAK, _KINDS = 16, 16, 32, 64
_EVERYWHERE = 1 << 20
"""A sight that no map limits [cells]."""
HALF_FRESH = 16.0
"""Steps after which what was seen is half as fresh as what is seen now."""


class Sensing(ABC):
    """What the world needs of a sensing component."""

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
        blank = state.replace(knowledge=before, watching=unwatched(state))
        begun = self.updated(blank, team, torch.ones_like(state.done))
        return begun.replace(watching=at_start(_watching(begun)))

    def updated(self, state: WorldState, team: Team, running: Tensor) -> WorldState:
        """Return the worlds with what the agents see now, and are told."""
        known = _known(state)
        record = ((state.step + 1)[:, None, None, None] * _KINDS + self._taken_for(state)).to(torch.int32)
        sees, watching = self._sees(state, team), _watching(state)
        knows, itself = torch.where(sees, record, known), watching.itself | sees
        if team.radio.sends_maps:
            state, told = team.radio.told(state, knows, _flies(state, team), running)
            itself = itself & (told <= knows)
            knows = torch.maximum(knows, told)
        goes_on = running[:, None, None, None]
        knows, itself = torch.where(goes_on, knows, known), torch.where(goes_on, itself, watching.itself)
        after = counted(state, watching, itself, _newest(known, knows, itself, state.step), self.recent)
        return state.replace(knowledge=knows, watching=_where(running, after, watching))

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
        ash, firebreak = (state.cells == 0) & state.burned, state.firebreak
        kinds = (state.cells + ash * _ASH + firebreak * _FIREBREAK)[:, None]
        if self.miss == 0.0 and self.false_alarm == 0.0:
            return kinds
        agents = state.vehicles.position.shape[1]
        draws = uniform(state.key, state.step, Stream.SENSING, (agents, *state.cells.shape[1:]))
        burns, stands = is_burning(state.cells)[:, None], is_tree(state.cells)[:, None]
        taken = torch.where(burns & (draws < self.miss), state.age[:, None], kinds)
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


def smoke(state: WorldState, length: int) -> Tensor:
    """Return the smoke at each cell, float32 [B, H, W]: sum over k = 0..length of burning(k cells upwind) / (1 + k).

    The wind is the map's mean, and upwind one of the cells nearest to its line; in calm air smoke stays where it is.

    Args:
        state: The worlds.
        length: How far smoke drifts [cells].
    """
    height, width = state.cells.shape[1:]
    east, north = state.wind.mean(dim=(2, 3)).unbind(1)
    speed = (east.square() + north.square()).sqrt()
    way = torch.stack((-north, east), dim=-1) / speed.clamp(min=1e-6)[:, None]  # rows grow south
    steps = torch.arange(length + 1, device=speed.device)
    back = (way[:, None] * steps[:, None]).round().to(torch.int64)  # [B, K, 2]
    row = torch.arange(height, device=speed.device) - back[..., 0, None]
    column = torch.arange(width, device=speed.device) - back[..., 1, None]
    on_map = ((row >= 0) & (row < height))[..., :, None] & ((column >= 0) & (column < width))[..., None, :]
    index = row.clamp(0, height - 1)[..., :, None] * width + column.clamp(0, width - 1)[..., None, :]
    burns = is_burning(state.cells).to(torch.float32).flatten(1)
    upwind = burns.gather(1, index.flatten(1)).view_as(index) * on_map
    weight = 1.0 / (1.0 + steps)
    drifts = (speed > 1e-6)[:, None] | (steps == 0)
    return (upwind * (weight * drifts)[..., None, None]).sum(dim=1)


def known_codes(state: WorldState) -> Tensor:
    """Return the code that each agent knows of each cell, int32 [B, A, H, W]."""
    return _known(state) % _CODES


def read(record: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the code that records tell, uint8, and whether the cell was ash, and a firebreak, bool; of their shape."""
    kind = (record % _KINDS).to(torch.uint8)
    return kind % _CODES, (kind & _ASH) > 0, kind >= _FIREBREAK


def freshness(record: Tensor, step: Tensor) -> Tensor:
    """Return how fresh records are, h / (h + steps since) with h = 16; 0 of what was never seen. float32.

    Args:
        record: int32 [B, A, ...].
        step: The worlds' steps, int32 [B].
    """
    return torch.where(record >= _KINDS, HALF_FRESH / (HALF_FRESH + steps_since(record, step)), 0.0)


def steps_since(record: Tensor, step: Tensor) -> Tensor:
    """Return how old records are [steps], int32; step + 1 of what was never seen. The arguments are ``freshness``'s."""
    return step.view(-1, *[1] * (record.ndim - 1)) + 1 - record // _KINDS


def _newest(before: Tensor, records: Tensor, itself: Tensor, step: Tensor) -> Records:
    """Return what the team's newest records tell; before a step and after it, int32 [B, A, H, W]."""
    newest = records.amax(dim=1)
    return Records(
        burns=newest % _CODES >= FIRST_FIRE,
        burned_before=before.amax(dim=1) % _CODES >= FIRST_FIRE,
        since=steps_since(newest, step),
        fresh=freshness(newest, step),
        holders=itself & (records == newest[:, None]),
    )


def _where(running: Tensor, after: Watching, before: Watching) -> Watching:
    """Return what was watched, after a step in the worlds that go on, bool [B], and else before it."""
    old = before.leaves()
    return after.with_leaves(
        {
            name: torch.where(running.view(-1, *[1] * (leaf.ndim - 1)), leaf, old[name])
            for name, leaf in after.leaves().items()
        }
    )


def _watching(state: WorldState) -> Watching:
    if state.watching is None:
        raise ValueError("what the team of these worlds watched is not counted: let its sensing begin them")
    return state.watching


def _known(state: WorldState) -> Tensor:
    if state.knowledge is None:
        raise ValueError("agents of these worlds know nothing of their own: sensing is full")
    return state.knowledge
