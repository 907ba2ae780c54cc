"""Vehicles that join and leave: each arrives at its time, works, rests, and leaves.

A fire grows from its first minute and its crews arrive later, one after the other: which fires escape initial attack
follows from both (Fried and Fried 1996, "Simulating wildfire containment with realistic tactics", Forest Science 42).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.validation import check_fields, did_you_mean
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.random import Stream, log_deviation, named_key, normal
from warp_torchrl.world.mechanics.arrivals.timetable import NEVER, Duties
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.minutes import check_minutes, minutes_of_tick
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Action, Cover, WorldState
from warp_torchrl.world.team.places import block_at
from warp_torchrl.world.team.presence import PRESENCE
from warp_torchrl.world.team.start import distances_to, first_free
from warp_torchrl.world.team.team import Team

SPEEDS = {"ugv": 60.0, "uav": 180.0, "scout": 250.0, "tanker": 450.0}
"""Speed of travel by role [km/h]: a bulldozer on its transport, a light helicopter, a light aeroplane, an airtanker."""
_HOUR = 60.0


@dataclass(eq=False, repr=False)
class Presence(Batch):
    """The vehicles on the scene, and when each arrives and leaves."""

    present: Tensor  # bool [B,A], is on the scene
    arrives: Tensor  # float32 [B,A], when it first arrives, since the start of the episode [minutes]
    until_there: Tensor  # float32 [B,A], until it is there [minutes]; 0: is, 1e9: does not come
    until_gone: Tensor  # float32 [B,A], until it leaves [minutes]; 0: is not there, 1e9: stays
    entry: Tensor  # int64 [B,A,2], (row, column) where it joins [cells]
    steps: Tensor  # int32 [B,A], steps on the scene
    now: Tensor  # float32 [B], since the start of the episode [minutes]


@mechanic(PRESENCE)
@dataclass(frozen=True, kw_only=True)
class Arrivals(Mechanic):
    """Times at which vehicles join and leave. Mappings are by role, or by agent, whose name counts first.

    A vehicle that is not on the scene can only stay; others do not see it, hear it, or reckon with it. It joins where
    it started, or at the cell nearest to its station, with a full tank.

    Attributes:
        minutes: Until a vehicle is there, from the start of the episode [min]; with a station, until it sets out.
        stations: (row, column) of where it comes from, in cells of the landscape's source, on the map or off it. The
            way from there to where it joins is added at its speed.
        speeds: Speed of travel [km/h]; of roles that are not named 60 for ugv, 180 uav, 250 scout, 450 tanker.
        detour: Length of a way on roads over that as the crow flies, of vehicles that do not fly. It
            is about 1.2 in cities (Newell 1980); 1.3 is ours.
        variation: Coefficient of variation of these times, log-normal with median 1, drawn for each vehicle.
        stays: For how long it is on the scene at a time: a shift, or what its fuel lasts [min]; not named, for ever.
        away: For how long it is away between two stays, to rest or refuel [min]; not named, it does not come back. The
            guideline of NWCG for crews is an hour of rest for every two of work.
        until: When it leaves for good, from the start of the episode [min], as at nightfall.
        minutes_per_tick: Under laws without minutes; None: 10.

    Raises:
        ValueError: If a value is out of its range.
    """

    minutes: Mapping[str, float] = field(default_factory=dict)
    stations: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    speeds: Mapping[str, float] = field(default_factory=dict)
    detour: float = 1.3
    variation: float = 0.0
    stays: Mapping[str, float] = field(default_factory=dict)
    away: Mapping[str, float] = field(default_factory=dict)
    until: Mapping[str, float] = field(default_factory=dict)
    minutes_per_tick: float | None = None

    def __post_init__(self) -> None:
        check_fields(
            self,
            minutes=(0.0, 1e6),
            speeds=(0.1, 2000.0),
            detour=(1.0, 10.0),
            variation=(0.0, 3.0),
            stays=(1e-3, 1e6),
            away=(0.0, 1e6),
            until=(0.0, 1e6),
            minutes_per_tick=(1e-3, 1440.0),
        )

    def check(self, world: Rules) -> None:
        """Check that the team can stay, and has the vehicles that are named.

        Raises:
            ValueError: If not.
        """
        team = world.team
        check_minutes(world, self.name, self.minutes_per_tick)
        if not team.allow_stay:
            raise ValueError("team.allow_stay must be true where vehicles join and leave, mechanics.arrivals")
        known = list(dict.fromkeys((*team.agent_roles, *team.agent_names)))
        for key in ("minutes", "stations", "speeds", "stays", "away", "until"):
            for name in getattr(self, key):
                if name not in known:
                    raise ValueError(
                        f"mechanics.arrivals.{key} must name roles or agents of the team, {', '.join(known)}, "
                        f"got {name}{did_you_mean(name, known)}"
                    )
        for agent, role in zip(team.agent_names, team.agent_roles, strict=True):
            if (agent in self.stations or role in self.stations) and self._speed(agent, role) is None:
                raise ValueError(f"mechanics.arrivals.speeds must name each role with a station, got none for {role}")

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode, in which late vehicles wait where they will join."""
        entry, travel = self._ways(state, world.team)
        given = numbers(self._of_each(self.minutes, world.team, 0.0), travel.device)
        draws = normal(named_key(state.episode_key, self.name), 0, Stream.NAMED, (travel.shape[1],))
        arrives = (given + travel) * torch.exp(log_deviation(self.variation) * draws)
        now = torch.zeros_like(state.burning_area)
        table = self._duties(world.team).at(arrives, now[:, None])
        presence = Presence(
            **table._asdict(), arrives=arrives, entry=entry, steps=torch.zeros_like(state.vehicles.acts), now=now
        )
        return state.replace(vehicles=state.vehicles.replace(position=entry)).with_planes(self.name, presence)

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions]: to absent vehicles, stay alone."""
        stays = torch.arange(mask.shape[-1], device=mask.device) == int(Action.STAY)
        return torch.where(state.planes(self.name, Presence).present[..., None], mask, stays)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step, in which vehicles have joined and left."""
        presence = after.planes(self.name, Presence)
        now = after.step * (minutes_of_tick(world, self.minutes_per_tick) / world.steps_per_tick)
        table = self._duties(world.team).at(presence.arrives, now[:, None])
        changes, comes = table.present != presence.present, table.present & ~presence.present
        vehicles, full = after.vehicles, -1 if world.team.tank is None else world.team.tank
        vehicles = vehicles.replace(
            position=torch.where(changes[..., None], presence.entry, vehicles.position),
            tank=torch.where(comes, full, vehicles.tank),
        )
        steps = presence.steps + (presence.present & running[:, None])
        presence = presence.replace(**table._asdict(), steps=steps, now=now)
        return after.replace(vehicles=vehicles).with_planes(self.name, presence)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``on_scene`` and ``first_arrival``."""
        return (Metric("on_scene", title="on scene"), Metric("first_arrival", "less", "min", title="first arrival"))

    def caption(self, state: WorldState) -> tuple[str, ...]:
        """Return how many vehicles are there."""
        present = state.planes(self.name, Presence).present[0]
        return (f"{int(present.sum())} of {len(present)} vehicles there",)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``on_scene``, the share of the agents' steps on the scene, and ``first_arrival`` [min].

        That is when the first vehicle arrived, and until now where none has.
        """
        presence = state.planes(self.name, Presence)
        steps = (state.step * presence.steps.shape[1]).clamp(min=1)
        first = presence.arrives.amin(dim=1).minimum(presence.now)
        return {"on_scene": presence.steps.sum(dim=1) / steps, "first_arrival": first}

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``is_there``, ``hours_until_there``, ``hours_until_gone`` and ``others_to_come``."""
        return ("is_there", "hours_until_there", "hours_until_gone", "others_to_come")

    def status(self, state: WorldState) -> Tensor:
        """Return whether an agent is there, the hours until it is and until it leaves, and the share still to come.

        Hours are 3 at most, which is never too; the share is that of the other agents. float32 [B, A, 4].
        """
        presence = state.planes(self.name, Presence)
        there, gone = ((each / _HOUR).clamp(max=3.0) for each in (presence.until_there, presence.until_gone))
        comes = _comes(presence).to(torch.float32)
        others = (comes.sum(dim=1, keepdim=True) - comes) / max(comes.shape[1] - 1, 1)
        return torch.stack((presence.present.to(torch.float32), there, gone, others), dim=-1)

    def critic_entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``to_come``."""
        return ("to_come",)

    def critic(self, state: WorldState, side: int) -> Tensor:
        """Return how many vehicles will join in each block, each exp(-hours until then), float32 [B, 1, side, side]."""
        presence = state.planes(self.name, Presence)
        soon = torch.exp(-presence.until_there / _HOUR) * _comes(presence)
        blocks = one_hot(block_at(presence.entry, state, side), side**2).to(torch.float32)
        return (soon[:, None] @ blocks).unflatten(-1, (side, side))

    def _ways(self, state: WorldState, team: Team) -> tuple[Tensor, Tensor]:
        """Return where each vehicle joins, int64 [B, A, 2] [cells], and its minutes of travel, float32 [B, A]."""
        entry, (height, width) = state.vehicles.position, state.cells.shape[1:]
        travel, edge = (
            torch.zeros_like(entry[..., 0], dtype=torch.float32),
            numbers((height - 1, width - 1), entry.device),
        )
        taken = (state.cover == int(Cover.LAKE)) | is_burning(state.cells)
        for station in dict.fromkeys(self.stations.values()):
            place = numbers(station, entry.device).expand(len(entry), 2)
            corner = state.landscape.corner
            place = place if corner is None else place - corner
            base = place.round().minimum(edge).clamp(min=0.0).to(torch.int64)
            nearest = first_free(distances_to(base, height, width), taken, team.n_agents)
            away = torch.linalg.vector_norm(nearest - place[:, None], dim=-1) * (state.ground.cell_size / 1000.0)
            pace = self._minutes_a_kilometre(team, station)
            theirs = torch.tensor([each > 0.0 for each in pace], device=entry.device)
            entry = torch.where(theirs[:, None], nearest, entry)
            travel = torch.where(theirs, away * numbers(pace, entry.device), travel)
        return entry, travel

    def _minutes_a_kilometre(self, team: Team, station: tuple[float, float]) -> tuple[float, ...]:
        """Return the minutes of each vehicle for a kilometre as the crow flies; 0 of those of other stations."""
        minutes = []
        for agent, role in zip(team.agent_names, team.agent_roles, strict=True):
            speed, own = self._speed(agent, role), self.stations.get(agent, self.stations.get(role))
            longer = 1.0 if ROLES[role].flies else self.detour
            minutes.append(_HOUR * longer / speed if own == station and speed is not None else 0.0)
        return tuple(minutes)

    def _speed(self, agent: str, role: str) -> float | None:
        return self.speeds.get(agent, self.speeds.get(role, SPEEDS.get(role)))

    def _duties(self, team: Team) -> Duties:
        """Return how each vehicle works and rests."""
        return Duties(*(self._of_each(each, team, NEVER) for each in (self.stays, self.away, self.until)))

    @staticmethod
    def _of_each(told: Mapping[str, float], team: Team, otherwise: float) -> tuple[float, ...]:
        """Return the number of each vehicle in a mapping, by its name or else its role."""
        pairs = zip(team.agent_names, team.agent_roles, strict=True)
        return tuple(told.get(agent, told.get(role, otherwise)) for agent, role in pairs)


def _comes(presence: Presence) -> Tensor:
    """Return the absent vehicles that will arrive, bool [B, A]."""
    return ~presence.present & (presence.until_there < NEVER)
