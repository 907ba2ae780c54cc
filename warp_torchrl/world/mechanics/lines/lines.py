"""Fireline at the rates of crews and bulldozers, fire put out at that of water, and flames that nobody works at.

An act that would clear a cell, or put out its fire, does a share of the work; the cell changes once all is done.
Agents at one cell add up, and work stays where it was left.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.constants import numbers, whole_numbers
from warp_torchrl.world.behaviour.firebreaks import intensity_of
from warp_torchrl.world.law.flames import flames_of, heat_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.lines.planning import open_fire, steps_alone, steps_left
from warp_torchrl.world.mechanics.lines.production import BUILDERS, kinds_of
from warp_torchrl.world.mechanics.lines.tasks import (
    AIRCRAFT,
    DONE,
    LATENT,
    Lines,
    Pace,
    at_fire,
    at_line,
    fire_beside,
    progress,
)
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Action, ActionResult, WorldState
from warp_torchrl.world.team.abilities import AgentContext, own_cell
from warp_torchrl.world.team.acting import Attempts, TakeEffect


@mechanic("lines")
@dataclass(frozen=True, kw_only=True)
class FireLines(Mechanic):
    """Rates at which vehicles build line and put out fire, and limits of the flames at which they do.

    A cell is as many metres of line as its side, built at the rate of its fuel and slope (``production``). To put out
    the fire of a cell of side s takes

        t = s I f / (w L e)

    minutes: the heat that its front of intensity I, as it goes towards the agent, releases in the time f that flames
    stay at a place, over the heat that water takes up; L is 2.6 MJ/kg. Aircraft drop what they have at once. The
    balance is ours; that of Hansen (2012) gives the least flow in the same way.

    No one works at flames longer than those of the hauling chart (Andrews and Rothermel 1982; NWCG PMS 461): ``clear``
    is closed if a front beside the agent would come with such flames to its cell, ``extinguish`` if one goes with such
    from the fire to the agent.

    Attributes:
        means: What each role works with, ``crew1``, ``crew2`` or ``dozer``; a role that it does not name is an aircraft
            if it flies, else a bulldozer.
        gain: Factor on the rates of line.
        hand_limit: Longest flames at which crews work [m].
        dozer_limit: Longest flames at which bulldozers work [m].
        aircraft_limit: Longest flames that aircraft put out [m].
        hand_width: Width of the line of a crew [m], which mechanic ``breach`` reads.
        dozer_width: Width of the line of a bulldozer [m].
        water: w, that a vehicle on the ground brings to the fire [kg/s].
        efficiency: e, share of the water that takes up heat.
        flaming: f [s]; 8 minutes for each inch of the fuel's diameter (Anderson 1969), 30 s for twigs.
        flame_length: Of flames under laws other than ``rate`` [m].
        minutes_per_tick: Under these, of a tick of the fire.

    Raises:
        ValueError: If a value is out of its range, or a role is unknown.
    """

    means: Mapping[str, Literal["crew1", "crew2", "dozer"]] = field(default_factory=dict)
    gain: float = 1.0
    hand_limit: float = 1.2
    dozer_limit: float = 2.4
    aircraft_limit: float = 3.4
    hand_width: float = 0.9
    dozer_width: float = 3.0
    water: float = 1.0
    efficiency: float = 0.3
    flaming: float = 30.0
    flame_length: float = 1.0
    minutes_per_tick: float = 5.0

    maps: ClassVar = {"line": lambda state: line_map(state)}

    def __post_init__(self) -> None:
        limits = dict.fromkeys(("hand_limit", "dozer_limit", "aircraft_limit", "flame_length"), (0.0, 25.0))
        check_fields(
            self,
            gain=(0.001, 1000.0),
            hand_width=(0.1, 25.0),
            dozer_width=(0.1, 25.0),
            water=(0.001, 1e5),
            efficiency=(0.001, 1.0),
            flaming=(0.0, 3600.0),
            minutes_per_tick=(1e-3, 1440.0),
            **limits,
        )
        if unknown := [role for role in self.means if role not in ROLES]:
            raise ValueError(f"means must name roles of {', '.join(ROLES)}, got {unknown[0]}")

    def check(self, world: Rules) -> None:
        """Check that what was given is read under the world's law.

        Raises:
            ValueError: If not.
        """
        for name in ("flame_length", "minutes_per_tick"):
            if isinstance(world.fire, RateFire) and getattr(self, name) != getattr(FireLines(), name):
                raise ValueError(f"mechanics.lines.{name} is read under other laws than rate alone, got it under rate")

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds in which no work is done."""
        fire = world.fire
        means = whole_numbers(tuple(self._index(role) for role in world.team.agent_roles), state.cells.device)
        lines = Lines(
            heat=heat_of(fire, state) if isinstance(fire, RateFire) else None,
            kind=kinds_of(state, world),
            work=torch.zeros_like(state.cells, dtype=torch.int16),
            means=means.expand(len(state.cells), -1).contiguous(),
            worked=torch.zeros_like(state.step),
            minutes=self._minutes(world),
            last_spreading=fire.last_spreading,
        )
        return state.with_planes(self.name, lines)

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions]: no work at flames that are too long, or at no pace.

        An agent that could do nothing else is shown what it was, which then does nothing.
        """
        share = torch.stack(
            (at_fire(state, fire_beside(state)[0], self._pace).share, at_line(state, self._pace).share), dim=-1
        )
        after = mask.clone()
        after[..., int(Action.EXTINGUISH) : int(Action.CLEAR) + 1] &= share > 0
        return torch.where(after.any(dim=-1, keepdim=True), after, mask)

    def around(self, state: WorldState, attempts: Attempts, take_effect: TakeEffect) -> tuple[WorldState, ActionResult]:
        """Let the agents work, and hold back the acts that their work does not complete.

        Agents that work at one cell are not redundant; the first of them is credited when it is completed. Who cannot
        work takes no water. Where mechanic ``drops`` lets aircraft drop, it says what that does.
        """
        lines, target = state.planes(self.name, Lines), attempts.target
        puts_out = attempts.action == int(Action.EXTINGUISH)
        ours = attempts.acts & (puts_out | (attempts.action == int(Action.CLEAR)))
        share = torch.where(puts_out, at_fire(state, target, self._pace).share, at_line(state, self._pace).share)
        able = ours & (share > 0)
        aircraft, widths = state.plane("drops", "aircraft"), whole_numbers(self._widths, target.device)[lines.means]
        drops = torch.zeros_like(able) if aircraft is None else able & puts_out & aircraft
        made = progress(lines.work, target, puts_out, torch.where(able & ~drops, share, 0), widths)
        held = attempts._replace(
            acts=torch.where(ours, (made.first & made.done) | drops, attempts.acts),
            takes_water=attempts.takes_water & (able | ~ours),
            is_useful=attempts.is_useful | made.works,
        )
        after, result = take_effect(state, held)
        works, work = made.works, made.work
        if aircraft is not None:  # fire that a drop puts out is done
            hits = drops & result.credited
            works, work = works | hits, progress(work, target, puts_out, torch.where(hits, DONE, 0), widths).work
        lines = lines.replace(work=work, worked=lines.worked + works.sum(dim=1, dtype=torch.int32))
        return after.with_planes(self.name, lines), result

    def workable(self, state: WorldState, world: Rules) -> Tensor | None:
        """Return the burning cells that some agent can work at, bool [B, H, W]; None where all flames are alike."""
        heat, roles = state.planes(self.name, Lines).heat, [ROLES[each] for each in world.team.roles]
        of_roles = zip(world.team.roles, roles, strict=True)
        limits = [self._strongest[self._index(name)] for name, role in of_roles if "extinguish" in role.abilities]
        return None if heat is None else open_fire(state, heat, max(limits, default=0.0))

    def steps_to_clear(self, state: WorldState, world: Rules) -> Tensor | None:
        """Return how many steps of one agent the line of each cell still takes, float32 [B, H, W]."""
        clears = [self._index(role) for role in world.team.agent_roles if "clear" in ROLES[role].abilities]
        return steps_left(state, clears, self.gain) if clears else None

    def steps_to_put_out(self, state: WorldState, cells: Tensor) -> Tensor | None:
        """Return the steps that each agent alone takes to put out fires, float32 [B, A, K]; inf at flames too long."""
        return steps_alone(state, cells, self._pace)

    def steps_here(self, state: WorldState) -> tuple[Tensor, Tensor] | None:
        """Return the steps that each agent alone takes to put out the fire beside it, and to clear its cell."""
        fire, line = at_fire(state, fire_beside(state)[0], self._pace), at_line(state, self._pace)
        return DONE / fire.share.to(torch.float32), DONE / line.share.to(torch.float32)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``at_work``."""
        return (Metric("at_work", title="at work"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``at_work``, the share of the agents' steps in which they built line or put out fire."""
        lines = state.planes(self.name, Lines)
        return {"at_work": lines.worked / (state.step * lines.means.shape[1]).clamp(min=1)}

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return the names of the numbers on work."""
        return ("line_done", "line_pace", "fire_done", "fire_pace", "flames")

    def status(self, state: WorldState) -> Tensor:
        """Return the numbers on each agent's work, float32 [B, A, 5].

        The share done of the line of its cell, and that which a step adds; both of the fire that it would put out; and
        the flames that it would work at over the longest at which it can.
        """
        (beside, has_fire), own = fire_beside(state), own_cell(state)
        lines, has_tree = state.planes(self.name, Lines), AgentContext.at(state.cells, own) > 0
        line, fire, work = at_line(state, self._pace), at_fire(state, beside, self._pace), lines.work
        done = AgentContext.at(work, own).clamp(min=0), AgentContext.at(-work, beside).clamp(min=0) * has_fire
        strongest = torch.maximum(line.intensity, fire.intensity * has_fire)
        flames = flames_of(strongest) / numbers(self._limits, own.device)[lines.means].clamp(min=0.1)
        shares = (done[0], line.share * has_tree, done[1], fire.share * has_fire)
        return torch.stack((*(each / DONE for each in shares), flames.clamp(max=3.0)), dim=-1)

    def _index(self, role: str) -> int:
        """Return what a role works with, its index in ``BUILDERS``, or ``AIRCRAFT``."""
        if role in self.means:
            return BUILDERS.index(self.means[role])
        return AIRCRAFT if ROLES[role].flies else BUILDERS.index("dozer")

    def _minutes(self, world: Rules) -> float:
        """Return the minutes of a step."""
        fire = world.fire
        return (fire.minutes if isinstance(fire, RateFire) else self.minutes_per_tick) / world.steps_per_tick

    @property
    def _pace(self) -> Pace:
        per_intensity = self.flaming / (self.water * self.efficiency * LATENT)
        return Pace(self._strongest, intensity_of(self.flame_length), per_intensity, self.gain)

    @property
    def _widths(self) -> tuple[int, ...]:
        """Return the width of the line of each means [dm]."""
        return tuple(round(10.0 * each) for each in (self.hand_width, self.hand_width, self.dozer_width, 0.0))

    @property
    def _limits(self) -> tuple[float, ...]:
        """Return the longest flames of each means [m]."""
        return self.hand_limit, self.hand_limit, self.dozer_limit, self.aircraft_limit

    @property
    def _strongest(self) -> tuple[float, ...]:
        """Return the intensity of these [kW/m]."""
        return tuple(intensity_of(each) for each in self._limits)


def line_map(state: WorldState) -> Tensor:
    """Return how much of the line of each cell is done, 0..255, uint8 [B, H, W]; of a finished one 0."""
    begun = state.planes("lines", Lines).work.clamp(min=0) * (state.firebreak == 0)
    return (begun // (DONE // 256)).clamp(max=255).to(torch.uint8)
