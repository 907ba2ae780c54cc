"""Limited sight: agents know of the fire what they, and others whose maps reach them, have seen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.sensing.smoke import drifted, smoke, sources
from warp_torchrl.world.mechanics.sensing.watching import (
    Memory,
    at_start,
    counted,
    memory_of,
    unwatched,
)
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.records import KNOWLEDGE, freshness, kept, kinds, read, recorded, steps_since
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState
from warp_torchrl.world.team.hearing import Hearing
from warp_torchrl.world.team.knowledge import Sensing
from warp_torchrl.world.team.places import in_reach
from warp_torchrl.world.team.presence import on_scene, pairs_there
from warp_torchrl.world.team.team import Team

_EXPLAINED = 0.05
"""Smoke of known fires that is enough to hide a cell."""


@dataclass(frozen=True, kw_only=True)
class Sight(Sensing, Mechanic):
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

    name: ClassVar[str] = KNOWLEDGE
    is_knowledge: ClassVar[bool] = True

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

    @property
    def errors(self) -> tuple[float, float]:
        """Return ``miss`` and ``false_alarm``."""
        return self.miss, self.false_alarm

    def reach(self, team: Team) -> list[int]:
        """Return how far each agent sees [cells]."""
        return [self.radius_of.get(role, self.radius) for role in team.agent_roles]

    def knows_where(self, state: WorldState, team: Team, hearing: Hearing) -> tuple[Tensor, Tensor]:
        """Return of which others each agent knows where they are, bool [B, A, A], and where, int64 [B, A, A, 2].

        It knows where those are that it sees, and where those were whose packets reach it, when they sent them.
        """
        sees, hears = others_in_sight(state, self.reach(team)), hearing.arriving(state, _flies(state, team))
        here, then = state.vehicles.position[:, None], hearing.places(state)[:, None]
        return hears | pairs_there(state, sees), torch.where(sees[..., None], here, then)

    def signs(self, state: WorldState, team: Team, known: Tensor) -> Tensor | None:
        """Return where smoke may come from that no known fire explains, float32 [B, G, H, W]; None without smoke.

        A cell within reach that nobody sees lies in smoke: something burns there or upwind of it, see ``sources``.
        """
        if self.smoke == 0.0:
            return None
        groups, wind = known.shape[1], state.wind.repeat_interleave(known.shape[1], dim=0)
        reach, unseen = self._in_reach(state, team), steps_since(kept(state), state.step) > 0
        if groups == 1:
            reach, unseen = reach.any(dim=1, keepdim=True), unseen.all(dim=1, keepdim=True)
        unexplained = drifted(known.flatten(0, 1), wind, self.smoke_length) < _EXPLAINED
        hidden = (reach & unseen).flatten(0, 1) & unexplained
        return sources(hidden, wind, self.smoke_length).unflatten(0, (-1, groups))

    def why_eager(self) -> str | None:
        """Return that steps of agents that do not see all are not compiled."""
        return "a step of agents that do not see all is not compiled"

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode with what the agents see where they start."""
        agents = state.vehicles.position.shape[1]
        before = state.landscape.age.to(torch.int32)[:, None].expand(-1, agents, -1, -1)
        blank = state.with_planes(self.name, unwatched(state, before))
        begun = self.step(state, blank, torch.ones_like(state.done), world)
        return begun.with_planes(self.name, at_start(memory_of(begun)))

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step with what the agents of those that go on see now, and are told."""
        memory, record = memory_of(after), recorded(self._taken_for(after), after.step)
        sees = self._sees(after, world.team)
        knows, itself = torch.where(sees, record, memory.records), memory.itself | sees
        if world.hearing.sends_maps:
            after, told = world.hearing.told(after, knows, _flies(after, world.team), running)
            itself = itself & (told <= knows)
            knows = torch.maximum(knows, told)
        return after.with_planes(self.name, _where(running, counted(after, memory, knows, itself, self.recent), memory))

    def assumed(self, state: WorldState, world: Rules) -> WorldState:
        """Return the worlds of the newest records: the team's if it shares its maps everywhere, else each agent's.

        A fire is as young as its stage allows; what is wet is known of cells that are seen now.
        """
        records = kept(state)
        if world.hearing.is_everywhere and world.hearing.sends_maps:
            records = records.amax(dim=1, keepdim=True)
        views, now = records.shape[1], recorded(torch.zeros_like(state.step), state.step)
        is_seen = (records >= now[:, None, None, None]).flatten(0, 1)
        code, ash, cleared = (each.flatten(0, 1) for each in read(records))
        burns, none = is_burning(code), torch.zeros_like(code)
        bare = state if views == 1 else state.without_planes(KNOWLEDGE)
        rows = torch.arange(len(state.key), device=code.device).repeat_interleave(views)
        own = bare if views == 1 else bare[rows]
        own = own.replace(
            cells=code,
            age=torch.where(burns, own.landscape.age, 0),
            stage_age=None if own.stage_age is None else none,
            burned=ash,
            firebreak=cleared,
            wet=torch.where(is_seen, own.wet, 0),
            extinguished=torch.zeros_like(ash),
        )
        return world.fire.lit(world.fire.started(own), burns)

    def worth_seeing(self, state: WorldState, world: Rules) -> Tensor:
        """Return how stale each agent's records are, 1 - freshness, float32 [B, A, H, W]."""
        return 1.0 - freshness(kept(state), state.step)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``watched``, ``found`` and ``uncertainty``."""
        return (Metric("watched", "more"), Metric("found", "more"), Metric("uncertainty", "less", unit="1"))

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return how well the team keeps the fire in sight.

        ``watched`` is the share of the front that it saw burn within the last ``recent`` steps, ``found`` that which it
        knows to burn, both means over the steps with a front. ``uncertainty`` is 1 - freshness of its newest records,
        mean over cells and steps.
        """
        memory = memory_of(state)
        fronts = memory.fronts.clamp(min=1)
        return {
            "watched": memory.watched / fronts,
            "found": memory.found / fronts,
            "uncertainty": memory.uncertainty / state.step.clamp(min=1),
        }

    def _sees(self, state: WorldState, team: Team) -> Tensor:
        """Return which cells each agent sees, bool [B, A, H, W]."""
        sees = self._in_reach(state, team)
        if self.smoke == 0.0:
            return sees
        clear = torch.exp(-self.smoke * smoke(state, self.smoke_length))
        draws = uniform(state.key, state.step, Stream.SMOKE, tuple(sees.shape[1:]))
        return sees & (draws < clear[:, None])

    def _in_reach(self, state: WorldState, team: Team) -> Tensor:
        """Return which cells are within reach of each agent on the scene, bool [B, A, H, W]."""
        reach, there = in_reach(state, self.reach(team)), on_scene(state)
        return reach if there is None else reach & there[..., None, None]

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


def _where(running: Tensor, after: Memory, before: Memory) -> Memory:
    """Return what was kept, after a step in the worlds that go on, bool [B], and else before it."""
    old = before.leaves()
    return after.with_leaves(
        {
            name: torch.where(running.view(-1, *[1] * (leaf.ndim - 1)), leaf, old[name])
            for name, leaf in after.leaves().items()
        }
    )
