"""The automaton in metres and minutes: fires that spread at the rates of a fuel model."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, Self

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.geometry import grow, neighbour_in
from warp_torchrl.world.arrays.random import Stream, log_deviation, uniform, uniform_at
from warp_torchrl.world.behaviour.crown import CrownModel
from warp_torchrl.world.behaviour.fbp_fuels import CURING
from warp_torchrl.world.behaviour.moistures import fine_moisture, in_force, moisture_row
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law import arrivals
from warp_torchrl.world.law.arrivals import RATE, Arrivals, Paces, Travel, arrivals_in, metric, own_cell
from warp_torchrl.world.law.automaton import Automaton, Beside, at_cells
from warp_torchrl.world.law.cells import is_burning, is_tree
from warp_torchrl.world.law.fuel_bed import COVER_FUEL, FuelBed, gradient, listed
from warp_torchrl.world.law.mapped_fuel import check_fuel, has_own_table, told_fuel
from warp_torchrl.world.law.travel import NEVER, rate_from, travel
from warp_torchrl.world.state.state import FIRST_FIRE, Air, Ground, Landscape, WorldState
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.terrain.source import LandscapeSource

TICKS_PER_CELL = 2
"""Ticks in which the fastest fire crosses a cell: with one the narrowest heads fall back by a tenth more."""
_STAGES = 5
_LONGEST_WAIT = 255  # ticks, of a byte


@dataclass(frozen=True, kw_only=True)
class RateFire(Automaton):
    """Law ``rate``: a fire reaches each cell at the rate of spread of its fuel, slope, wind and moisture.

    The rates are those of ``world.behaviour``; how they make times is written in ``world.law.travel``. A
    tick is ``minutes_per_tick``. A cell that the fire has reached burns for ``residence`` minutes, and as long as a
    neighbour that can ignite has not been reached: the fire's edge burns until it has nowhere to go. Then it is ash.

    Rates differ from cell to cell and from fire to fire by log-normal factors of median 1, drawn for each episode:
    the same ones from its first tick to its last. Without them the arrival times are those of least travel time.

    Attributes:
        model: Fuel models: ``fbfm13`` (Anderson 1982), ``fbfm40`` (Scott and Burgan 2005) or ``fbp`` (Canadian).
        fuel_models: Fuel models of one's own by code, in place of those of ``model``: each a mapping of the fields of
            ``rates.fuel_models.FuelModel``.
        minutes_per_tick: Minutes of a tick; None takes half of what the fastest fire needs for a cell of the landscape.
        residence: Minutes that a cell burns at least.
        wet_minutes: Minutes for which a tree that was put out cannot ignite.
        moisture: Percent by name, of those that the wind tells nothing of: see ``moistures.MOISTURES``.
        fuel_of_cover: Fuel code of lake, wetland, grassland, forest and bare ground, for landscapes without fuel codes;
            None takes those of ``fuel_bed.COVER_FUEL``. Where given, the codes of a landscape with a table of the
            user's own are classes of land cover, and the fuel is that of their cover.
        fuel_gain: Factor on the rate of each fuel code that it names.
        rate_gain: Factor on all rates.
        wind_gain: Factor on the wind's speed.
        slope_gain: Factor on the slope's tangent.
        crown: Rule of the rate of crown fire in Rothermel's fuels, ``cruz`` or ``rothermel`` (see ``behaviour.crown``),
            where the landscape has canopy cover, height, base height and bulk density; ``none`` for surface fire alone.
        foliar_moisture: Water in the needles of crowns [% of dry weight]; None takes 100 in Rothermel's fuels and 97 in
            Canadian ones.
        curing: Cured grass of the Canadian O-1 [%]; None takes 80. Of Rothermel's fuels ``moisture.live_herbaceous``
            says it.
        green: Whether the leaves of aspen are out in Canadian fuels: whether 13 is D-2, 60 M-2 and 90 M-4; None: no.
        percent_conifer: Conifers in the Canadian M-1 and M-2 whose code does not say it [%].
        percent_dead_fir: Dead balsam fir in the Canadian M-3 and M-4 whose code does not say it [%].
        grass_load: Fuel in Canadian grass [kg/m2].
        acceleration: Whether fires from a point take time to reach their rates (see ``behaviour.acceleration``).
            Predictions and calibrations read it; worlds that step refuse it.
        cell_deviation: Coefficient of variation of the rates from cell to cell.
        fire_deviation: Coefficient of variation of the rates from fire to fire.

    Raises:
        ValueError: If a value is out of its range.
    """

    youngest_fuel: int = 1
    model: Literal["fbfm13", "fbfm40", "fbp"] = "fbfm40"
    fuel_models: Mapping[int, Any] = field(default_factory=dict)
    minutes_per_tick: float | None = None
    residence: float = 20.0
    wet_minutes: float = 60.0
    moisture: Mapping[str, float] = field(default_factory=dict)
    fuel_of_cover: tuple[int, int, int, int, int] | None = None
    fuel_gain: Mapping[int, float] = field(default_factory=dict)
    rate_gain: float = 1.0
    wind_gain: float = 1.0
    slope_gain: float = 1.0
    crown: CrownModel = "cruz"
    foliar_moisture: float | None = None
    curing: float | None = None
    green: bool | None = None
    percent_conifer: float = 50.0
    percent_dead_fir: float = 35.0
    grass_load: float = 0.35
    acceleration: bool = False
    cell_deviation: float = 0.1
    fire_deviation: float = 0.0
    _by_cover: bool = field(default=False, init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(
            self,
            minutes_per_tick=(1e-3, 1440.0),
            residence=(0.0, 1e5),
            wet_minutes=(0.0, 1e5),
            rate_gain=(0.0, 100.0),
            wind_gain=(0.0, 10.0),
            slope_gain=(0.0, 10.0),
            foliar_moisture=(20.0, 400.0),
            curing=(0.0, 100.0),
            percent_conifer=(0.0, 100.0),
            percent_dead_fir=(0.0, 100.0),
            grass_load=(0.0, 100.0),
            cell_deviation=(0.0, 2.0),
            fire_deviation=(0.0, 2.0),
        )
        _ = moisture_row(self.moisture), self.bed  # refuse what they do not know

    @property
    def minutes(self) -> float:
        """Return the minutes of a tick in force; 1 where no landscape has set them."""
        return 1.0 if self.minutes_per_tick is None else self.minutes_per_tick

    @property
    def keeps(self) -> tuple[str, ...]:
        """See ``Automaton``: the times of arrival."""
        return (RATE,)

    @property
    def ticks_per_stage(self) -> int:
        """Return the ticks that a burning stage lasts: a fifth of the residence."""
        return min(_LONGEST_WAIT, max(1, round(self.residence / _STAGES / self.minutes)))

    @property
    def wet_for(self) -> int:
        """Return the ticks for which a tree that was put out cannot ignite."""
        return min(_LONGEST_WAIT, math.ceil(self.wet_minutes / self.minutes))

    @cached_property
    def bed(self) -> FuelBed:
        """Return the fuels with their factors."""
        return FuelBed(
            model=self.model,
            fuel_models=self.fuel_models,
            fuel_of_cover=COVER_FUEL[self.model] if self.fuel_of_cover is None else tuple(self.fuel_of_cover),
            fuel_gain=self.fuel_gain,
            rate_gain=self.rate_gain,
            wind_gain=self.wind_gain,
            slope_gain=self.slope_gain,
            crown=self.crown,
            foliar_moisture=self.foliar_moisture,
            curing=CURING if self.curing is None else self.curing,
            green=bool(self.green),
            percent_conifer=self.percent_conifer,
            percent_dead_fir=self.percent_dead_fir,
            grass_load=self.grass_load,
            by_cover=self._by_cover,
        )

    def on(self, landscape: LandscapeSource) -> Self:
        """Return the law on a landscape, which says whether its codes are fuels or classes of land cover.

        Raises:
            ValueError: If the fuel codes of the landscape are of another model, or the model lacks some.
        """
        law = self._going_by(self.fuel_of_cover is not None and has_own_table(landscape))
        law.bed.check(landscape)
        return law

    def check_fuel(self, landscape: Landscape) -> None:
        """Refuse landscapes with fuel codes that the model lacks.

        Raises:
            ValueError: With codes and cells.
        """
        check_fuel(self.bed.fuel(landscape), self.bed.table, "fire.fuel_models" if self.fuel_models else self.model)

    def told_fuel(self, landscape: Landscape) -> str:
        """Return in words how many cells of landscapes have each fuel, and which are no fuel."""
        return told_fuel(self.bed.fuel(landscape), self.bed.table)

    def alike(self) -> Self:
        """Return the law under which fires differ from cell to cell alone."""
        return replace(self, fire_deviation=0.0)._going_by(self._by_cover)

    def with_state(self, **state: Any) -> Self:
        """Return the law with another state of its fuel: ``curing``, ``green``, ``foliar_moisture``."""
        return replace(self, **state)._going_by(self._by_cover)

    def _going_by(self, cover: bool) -> Self:
        """Return the law that takes the fuel of the cover, or of the landscape's codes."""
        law = replace(self)
        object.__setattr__(law, "_by_cover", cover)
        law.__dict__.pop("bed")  # made before it was told
        return law

    def over(self, landscape: LandscapeSource, wind: Wind, cell_size: float) -> Self:
        """Return the automaton with the minutes of a tick that the fastest fire of some worlds asks for.

        Raises:
            ValueError: See ``on``.
        """
        if self.acceleration:
            raise ValueError("fire.acceleration must be false in worlds that step: warp predict and calibrate read it")
        law = self.on(landscape)
        if law.minutes_per_tick is not None:
            return law
        fastest = law.bed.fastest(landscape, wind, cell_size, moisture_row(law.moisture))
        minutes = min(60.0, max(0.05, float(f"{cell_size / fastest / TICKS_PER_CELL:.2g}")))
        return replace(law, minutes_per_tick=minutes)._going_by(law._by_cover)

    def flammability(self, landscape: Landscape) -> Tensor:
        """Return the square root of the rate on level ground in a wind of 5 m/s, of the fastest fuel's there."""
        return self.bed.flammability(landscape, moisture_row(self.moisture))

    def ground(self, landscape: Landscape, cell_size: float, key: Tensor) -> Ground:
        """See ``Automaton``."""
        pace = self.pace(key, (landscape.cover.shape[1], landscape.cover.shape[2]))
        return Ground(landscape, self.flammability(landscape), Paces(pace), cell_size)

    @property
    def draws(self) -> tuple[str, ...]:
        """Return that paces are drawn."""
        return ("ground.terms.pace",)

    def drawn_again(self, ground: Ground, key: Tensor) -> Ground:
        """See ``Automaton``: each world has paces of its own."""
        return ground.replace(terms=Paces(self.pace(key, (ground.alpha.shape[1], ground.alpha.shape[2]))))

    def at_rate(self, ground: Ground, factor: Tensor) -> Ground:
        """See ``Automaton``: times are divided by the factor."""
        if not isinstance(ground.terms, Paces):
            raise ValueError("the ground must be that of a fire with rates of spread")
        return ground.replace(terms=Paces(ground.terms.pace / factor[:, None, None]))

    def pace(self, key: Tensor, size: tuple[int, int]) -> Tensor:
        """Return the factor on the fire's times in each cell, float32 [B, H, W]: 1 over that on its rates."""
        return self._pace(key, uniform(key, 0, Stream.PACE, size))

    def pace_in(self, key: Tensor, window: Window) -> Tensor:
        """Return what ``pace`` does of the whole map in a window of it, float32 [B, h, w]."""
        u = uniform_at(key, 0, Stream.PACE, window.index()[None].to(key.device))
        return self._pace(key, u.view(len(key), window.height, window.width))

    def _pace(self, key: Tensor, u: Tensor) -> Tensor:
        fires = _log_normal(uniform(key, 1, Stream.PACE, (1, 1)), self.fire_deviation)
        return _log_normal(u, self.cell_deviation) * fires

    def air(self, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
        """See ``Automaton``."""
        spread = self.bed.spread(ground.landscape, wind, self._damp(Air(wind, moisture)), ground.cell_size)
        made = travel(spread.head, spread.direction, spread.length_to_breadth, ground.cell_size)
        return Air(wind, moisture, Travel(made))

    def head_at(self, state: WorldState, cell: Tensor) -> Spread:
        """Return the behaviour of the fire's head in some cells now, float32 [B, 1, n] each; cell is int64 [B, n]."""
        size, wind = state.ground.cell_size, state.wind
        rise = at_cells(gradient(state.landscape.elevation, state.cover, size), cell)[:, :, None]
        wind = wind if wind.shape[2:] == (1, 1) else at_cells(wind, cell)[:, :, None]
        return self.bed.spread(listed(state.landscape, cell), wind, self._damp(state.air), size, rise)

    def fine_moisture(self, air: Air) -> Tensor:
        """Return the moisture of fine dead fuel, float32 [B] [%]."""
        return fine_moisture(self._damp(air), self.bed.table is None)

    def _damp(self, air: Air) -> Tensor:
        """Return the moistures in force, float32 [B, 7] [%]."""
        row = moisture_row(self.moisture).to(air.wind.device)
        return in_force(air.moisture, row.expand(len(air.wind), -1))

    def started(self, state: WorldState) -> WorldState:
        """Return worlds whose fires have reached the cells that burn at minute 0."""
        return arrivals.started(state)

    def lit(self, state: WorldState, where: Tensor) -> WorldState:
        """Return worlds whose fires have reached these cells, bool [B, H, W], now, each from itself."""
        return arrivals.lit(state, where, self.now(state))

    def in_air(self, state: WorldState, air: Air) -> WorldState:
        """See ``Automaton``. The fire has gone as far as it has, and spreads at the new rates."""
        return arrivals.in_air(state, air, self.now(state), self.spreads(state), self.can_ignite(state))

    def next_arrivals(self, state: WorldState) -> Arrivals:
        """Return when the fire reaches each cell that can ignite and is near it, else ``NEVER``."""
        spreads, fuel = self.spreads(state), self.can_ignite(state)
        now = self.now(state)
        times, kindled = arrivals.sources(state, now, spreads, fuel), arrivals.kindled(state, now, fuel)
        beside = arrivals.beside(spreads, fuel, kindled)
        return arrivals.next_arrivals(state, times, spreads, beside, self.earliest(state))

    def tick(self, state: WorldState, u: Tensor, ticks_now: Tensor) -> WorldState:
        """See ``Automaton``. What the fire reaches within the tick ignites, at the minute when it does."""
        return self.tick_to(state, u, ticks_now, self.next_arrivals(state))

    def tick_to(self, state: WorldState, u: Tensor, ticks_now: Tensor, coming: Arrivals) -> WorldState:
        """Advance as ``tick`` does, with these arrivals."""
        here = ticks_now[:, None, None]
        end = ((state.tick + 1) * self.minutes)[:, None, None]
        reached = coming.minutes <= end
        after = self.tick_with(state, u, ticks_now, torch.maximum(reached.to(torch.float32), self.spontaneous(state)))
        after = self._held(state, after)
        lit = (after.cells == FIRST_FIRE) & ~is_burning(state.cells)
        kept, waits = arrivals_in(state), is_tree(after.cells)
        minutes = torch.where(lit, torch.where(reached, coming.minutes, end), kept.minutes)
        origin = torch.where(lit, torch.where(reached, coming.origin, own_cell(state.cells)), kept.origin)
        minutes = torch.where(waits, torch.where(here, coming.minutes, kept.minutes), minutes)
        origin = torch.where(waits, torch.where(here, coming.origin, kept.origin), origin)
        return after.with_planes(RATE, Arrivals(minutes, origin))

    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return 1 where the fire arrives in the next tick, else a tick's share of the minutes until it does.

        Or p_spont, where that is more; float32 [B, H, W], 0 where nothing can ignite.
        """
        return self.share_of_tick(state, self.next_arrivals(state))

    def share_of_tick(self, state: WorldState, coming: Arrivals) -> Tensor:
        """Return what ``ignition_probability`` does of these arrivals."""
        wait = coming.minutes - self.now(state)
        spread = (self.minutes / wait.clamp(min=self.minutes)) * (coming.minutes < NEVER / 2)
        return spread if self.beta == 0.0 else torch.maximum(spread, self.spontaneous(state))

    def ignition_beside(self, state: WorldState, beside: Beside, rate: Tensor, air: Air) -> Tensor:
        """Return max_d pi_d min(1, the share of a cell that fire goes in a tick): see ``Automaton``.

        Of a front that passes, that share of the trees beside it is reached in a tick. Paces are not known.
        """
        count, size = rate.shape[1], state.ground.cell_size
        landscape = listed(state.landscape, beside.cell)
        rise = beside.of(gradient(state.landscape.elevation, state.cover, size))[:, :, None]
        wind = air.wind
        if wind.shape[2:] != (1, 1):
            wind = at_cells(wind.unflatten(0, (-1, count)), beside.cell).flatten(0, 1)[:, :, None]
        each = torch.arange(len(rate), device=rate.device).repeat_interleave(count)
        spread = self.bed.spread(landscape[each], wind, self._damp(air), size, rise[each])
        a, east, north = travel(spread.head, spread.direction, spread.length_to_breadth, size)[:, :, 0].unbind(1)
        chance = torch.zeros_like(a)
        for direction in range(8):
            share = rate_from((direction + 4) % 8, (a, east, north)) * (self.minutes * rate.flatten()[:, None])
            chance = torch.maximum(chance, share.clamp(max=1.0) * beside.spreads[each, direction])
        return chance.unflatten(0, (-1, count))

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each burning cell would reach in a tick of its own, float32 [B, H, W]; else 0.

        A neighbour that takes several ticks counts for its share of them.
        """
        total = torch.zeros_like(state.alpha)
        fuel, rates = self.can_ignite(state), metric(state.ground, state.air)
        for direction in range(8):
            rate = rate_from(direction, rates)
            share = (rate * self.minutes).clamp(max=1.0) * fuel
            total = total + neighbour_in((direction + 4) % 8, share)
        return total * self.spreads(state)

    def now(self, state: WorldState) -> Tensor:
        """Return the minutes since ignition, float32 [B, 1, 1]."""
        return (state.tick * self.minutes)[:, None, None]

    def earliest(self, state: WorldState) -> Tensor:
        """Return the least time of arrival that a cell gets in the next tick, float32 [B, 1, 1] [minutes].

        Fire that passes between cells comes to some before their neighbours have times. They burn when these have, and
        no more than a tick after the time that they get.
        """
        return self.now(state) - self.minutes

    def _held(self, before: WorldState, after: WorldState) -> WorldState:
        """Return the worlds after a tick in which cells that are about to burn out wait for their neighbours."""
        ends = (before.cells == self.last_spreading) & (after.cells != before.cells)
        holds = ends & grow(self.can_ignite(after))
        kept = {
            name: torch.where(holds, getattr(before, name), getattr(after, name))
            for name in ("cells", "age", "stage_age", "burned")
            if getattr(after, name) is not None
        }
        return after.replace(**kept)


def _log_normal(u: Tensor, variation: float) -> Tensor:
    """Return log-normal factors of median 1 and a coefficient of variation, from uniform draws in [0, 1)."""
    return torch.exp(
        log_deviation(variation) * math.sqrt(2.0) * torch.erfinv((2.0 * u - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6))
    )
