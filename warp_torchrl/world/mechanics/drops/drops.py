"""Aircraft that drop water or retardant along their heading, and load it again at a lake or at the base.

``extinguish`` of an aircraft is a drop. It covers cells along the heading, from the fire that would be put out. Fires
that the coverage holds go out; trees do not catch fire as long as the coverage holds the fronts that come.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.arrays.bytes import above
from warp_torchrl.world.backends.backend import advance_any, advance_rows
from warp_torchrl.world.behaviour.firebreaks import intensity_of
from warp_torchrl.world.law.anderson import anderson_numbers
from warp_torchrl.world.law.automaton import at_cells
from warp_torchrl.world.law.flames import heat_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.drops.loads import (
    LEAST,
    LITRES_PER_LEVEL,
    Drop,
    Load,
    Loads,
    coverage_map,
    fallen,
    held,
)
from warp_torchrl.world.mechanics.drops.readiness import HOURS, Limits, daylight_left, loading, may_drop
from warp_torchrl.world.mechanics.drops.smoke import smoke_at
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.role import ROLES, RoleTable
from warp_torchrl.world.state.state import Action, ActionResult, WorldState
from warp_torchrl.world.team.abilities import own_cell
from warp_torchrl.world.team.acting import Attempts, TakeEffect

_MOVES = 8


@mechanic("drops")
@dataclass(frozen=True, kw_only=True)
class Drops(Mechanic):
    """The loads of aircraft that extinguish, and when they may drop them.

    A load covers litres / (level x width) of a line, in whole cells. It holds fronts up to ``loads.held_intensity``.
    It loses half of its level in each half-life: water evaporates, retardant works without it. An aircraft loads for
    ``turnaround`` minutes at a lake or the base, retardant at the base alone. It drops nothing at night, nor where the
    smoke of more than so many burning cells drifts over it.

    Attributes:
        agent: What is dropped.
        litres: Of a load; 3,000 are those of a single-engine airtanker (800 US gallons).
        width: Of the pattern [m].
        level: Coverage level of a drop [US gallons to 100 square feet].
        holds: Longest flames that the level which the fuel needs holds [m].
        most: Flames over which no drop is of use [m].
        half_life: Of the level [minutes]; None: 15 of water, 120 of retardant.
        turnaround: Time to load, and to fly where the map ends before the place [minutes].
        begins: Hour of the day at which fires start.
        daylight: Hours from which and to which aircraft drop.
        smoke: Burning cells whose smoke is too much, each weighing 1 / (1 + k) from k cells away; None: none is.
        smoke_length: How far smoke drifts [cells].
        flame_length: Of flames under laws other than ``rate`` [m].
        minutes_per_tick: Under these, of a tick of the fire.

    Raises:
        ValueError: If a value is out of its range.
    """

    agent: Literal["water", "retardant"] = "water"
    litres: float = 3000.0
    width: float = 20.0
    level: float = 4.0
    holds: float = 2.4
    most: float = 3.4
    half_life: float | None = None
    turnaround: float = 5.0
    begins: float = 12.0
    daylight: tuple[float, float] = (6.0, 20.0)
    smoke: float | None = 3.0
    smoke_length: int = 6
    flame_length: float = 1.0
    minutes_per_tick: float = 5.0

    maps: ClassVar = {"coverage": coverage_map}

    def __post_init__(self) -> None:
        lengths = dict.fromkeys(("holds", "most", "flame_length"), (0.0, 25.0))
        check_fields(
            self,
            litres=(1.0, 1e6),
            width=(0.1, 1000.0),
            level=(0.1, 25.0),
            half_life=(0.1, 1e5),
            turnaround=(0.0, 1e4),
            begins=(0.0, HOURS),
            daylight=(0.0, HOURS),
            smoke=(0.0, 1e3),
            smoke_length=(1, 64),
            minutes_per_tick=(1e-3, 1440.0),
            **lengths,
        )

    def check(self, world: Rules) -> None:
        """Check that there are aircraft with tanks, and that what was given is read under the world's law.

        Raises:
            ValueError: If not.
        """
        if not any(map(_drops, world.team.roles)):
            raise ValueError(
                f"mechanics.drops needs an aircraft that extinguishes in team.roles, got {world.team.roles}"
            )
        if not world.team.tank:
            raise ValueError(f"team.tank must be 1 or more where aircraft drop loads, got {world.team.tank}")
        for name in ("flame_length", "minutes_per_tick"):
            if isinstance(world.fire, RateFire) and getattr(self, name) != getattr(Drops(), name):
                raise ValueError(f"mechanics.drops.{name} is read under other laws than rate alone, got it under rate")

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds in which nothing was dropped."""
        fire, vehicles = world.fire, state.vehicles
        minutes = fire.minutes if isinstance(fire, RateFire) else self.minutes_per_tick
        aircraft = torch.tensor([_drops(role) for role in world.team.agent_roles], device=state.cells.device)
        loads = Loads(
            heat=heat_of(fire, state) if isinstance(fire, RateFire) else None,
            fuel=anderson_numbers(fire, state.landscape).to(torch.uint8),
            coverage=torch.zeros_like(state.alpha),
            aircraft=aircraft.expand(vehicles.tank.shape).contiguous(),
            heading=torch.zeros_like(vehicles.last_action),
            waits=torch.zeros_like(vehicles.tank),
            smoke=self._smoke(state),
            drops=torch.zeros_like(state.step),
            hits=torch.zeros_like(state.step),
            minutes=minutes,
            turnaround=math.ceil(self.turnaround / (minutes / world.steps_per_tick)),
            last_spreading=fire.last_spreading,
        )
        return state.with_planes(self.name, loads)

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions]: no drop at night, in smoke, or while aircraft load."""
        after = mask.clone()
        after[..., int(Action.EXTINGUISH)] &= may_drop(state, self._limits)
        return torch.where(after.any(dim=-1, keepdim=True), after, mask)

    def grounded(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which aircraft load, bool [B, A]."""
        return state.planes(self.name, Loads).waits > 0

    def fills_at_base(self, state: WorldState) -> Tensor | None:
        """Return whose tanks fill at the base alone, bool [B, A]: aircraft with retardant; None of water."""
        return state.planes(self.name, Loads).aircraft if self.agent == "retardant" else None

    def around(self, state: WorldState, attempts: Attempts, take_effect: TakeEffect) -> tuple[WorldState, ActionResult]:
        """Let the other vehicles act, and then the loads fall; who may not drop keeps its load."""
        loads, running = state.planes(self.name, Loads), attempts.running
        ours = loads.aircraft & (attempts.action == int(Action.EXTINGUISH))
        tries = ours & attempts.acts
        falls = tries & may_drop(state, self._limits)
        held = attempts._replace(acts=attempts.acts & ~ours, takes_water=attempts.takes_water & (falls | ~tries))
        after, result = take_effect(state, held)
        drop = Drop(after, state.cells, falls, attempts.target, torch.zeros_like(falls))
        fell = advance_any(drop, falls, lambda whole: fallen(whole, self._load))
        after, hit = fell.state, fell.hit
        left = state.vehicles.tank - held.takes_water.to(torch.int32)
        tank, waits = loading(after, left, running, self.agent == "retardant")
        last_useful = torch.where(hit, state.step[:, None], after.vehicles.last_useful)
        loads = after.planes(self.name, Loads).replace(
            heading=torch.where(result.moved & (result.action < _MOVES), result.action, loads.heading),
            waits=waits,
            drops=loads.drops + falls.sum(dim=1, dtype=torch.int32),
            hits=loads.hits + hit.sum(dim=1, dtype=torch.int32),
        )
        after = after.replace(vehicles=after.vehicles.replace(tank=tank, last_useful=last_useful))
        return after.with_planes(self.name, loads), result.replace(credited=result.credited | hit)

    def after_tick(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        """Return worlds whose covered trees do not catch fire in the next tick, where the coverage holds."""
        return advance_rows(state, ticks_now, self._held)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``on_target``."""
        return (Metric("on_target", "more", title="drops on target"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``on_target``, the share of drops that put out a fire."""
        loads = state.planes(self.name, Loads)
        return {"on_target": loads.hits / loads.drops.clamp(min=1)}

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return the names of the numbers on drops."""
        return ("loaded", "drop_smoke", "daylight", "covered")

    def status(self, state: WorldState) -> Tensor:
        """Return the numbers on drops, float32 [B, A, 4].

        How much of the time to load is over, the smoke over the limit, the hours of daylight that are left over 12, and
        the coverage of the own cell over that of a drop.
        """
        loads, own = state.planes(self.name, Loads), own_cell(state)
        loaded = 1.0 - loads.waits / max(loads.turnaround, 1)
        smoke = torch.zeros_like(loaded) if loads.smoke is None else loads.smoke
        left = daylight_left(state, self._limits)[:, None].expand_as(loaded) / 12.0
        covered = at_cells(loads.coverage, own) / self.level
        limit = max(self.smoke or 0.0, 0.1)
        return torch.stack((loaded, smoke / limit, left, covered), dim=-1).clamp(0.0, 3.0)

    def picture_entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``covered``."""
        return ("covered",)

    def picture(self, state: WorldState, side: int) -> Tensor:
        """Return the share of each block that drops cover, float32 [B, A, 1, side, side]."""
        share = block_means(above(state.planes(self.name, Loads).coverage, LEAST), side)
        return share[:, None, None].expand(-1, state.vehicles.tank.shape[1], -1, -1, -1)

    @property
    def _load(self) -> Load:
        half_life = {"water": 15.0, "retardant": 120.0}[self.agent] if self.half_life is None else self.half_life
        area = self.litres / (LITRES_PER_LEVEL * self.level)
        return Load(area / self.width, self.level, self.holds, self.most, half_life, intensity_of(self.flame_length))

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step, with the smoke that is over the agents now."""
        return after.with_planes(self.name, after.planes(self.name, Loads).replace(smoke=self._smoke(after)))

    def _held(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        is_covered = state.planes(self.name, Loads).coverage.flatten(1).amax(dim=1) > 0.0
        return advance_rows(state, ticks_now & is_covered, lambda rows, ticks: held(rows, ticks, self._load))

    def _smoke(self, state: WorldState) -> Tensor | None:
        return None if self.smoke is None else smoke_at(state, self.smoke_length)

    @property
    def _limits(self) -> Limits:
        return Limits(self.begins, self.daylight, self.smoke)


def _drops(role: str) -> bool:
    """Return whether a role is that of aircraft that extinguish."""
    return ROLES[role].flies and "extinguish" in ROLES[role].abilities
