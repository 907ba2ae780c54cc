"""The automaton in metres and minutes: fires that spread at the rates of a fuel model."""

import math
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.geometry import grow, neighbour_in
from warp_torchrl.world.arrays.listing import in_all
from warp_torchrl.world.arrays.random import Stream, log_deviation, uniform, uniform_at
from warp_torchrl.world.behaviour.moistures import fine_moisture, in_force, moisture_row
from warp_torchrl.world.behaviour.rothermel import BedResponse
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law import arrivals
from warp_torchrl.world.law.arrivals import RATE, Arrivals, Beds, Paces, Travel, arrivals_in, metric, own_cell, terms_of
from warp_torchrl.world.law.automaton import Beside, at_cells
from warp_torchrl.world.law.cells import is_burning, is_tree
from warp_torchrl.world.law.listed import gradient_at, listed
from warp_torchrl.world.law.rate_options import RateOptions
from warp_torchrl.world.law.travel import NEVER, rate_from, travel
from warp_torchrl.world.state.state import FIRST_FIRE, Air, Ground, Landscape, WorldState
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.terrain.source import LandscapeSource

TICKS_PER_CELL = 2
"""Ticks in which the fastest fire crosses a cell: with one the narrowest heads fall back by a tenth more."""
_STAGES = 5
_LONGEST_WAIT = 255  # ticks, of a byte


@dataclass(frozen=True, kw_only=True)
class RateFire(RateOptions):
    """Law ``rate``: a fire reaches each cell at the rate of spread of its fuel, slope, wind and moisture.

    The rates are those of ``world.behaviour``; how they make times is written in ``world.law.travel``. A
    tick is ``minutes_per_tick``. A cell that the fire has reached burns for ``residence`` minutes, and as long as a
    neighbour that can ignite has not been reached: the fire's edge burns until it has nowhere to go. Then it is ash.

    Rates differ from cell to cell and from fire to fire by log-normal factors of median 1, drawn for each episode:
    the same ones from its first tick to its last. Without them the arrival times are those of least travel time.
    """

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

    def over(self, landscape: LandscapeSource, wind: Wind, cell_size: float) -> Self:
        """Return the automaton with the minutes of a tick that the fastest fire of some worlds asks for.

        Raises:
            ValueError: See ``on``.
        """
        if self.acceleration:
            raise ValueError("fire.acceleration must be false in worlds that step: warp predict and calibrate read it")
        law = self.on(landscape)._changed(_wind_wanders=wind.wanders)
        if law.minutes_per_tick is not None:
            return law
        fastest = law.bed.fastest(landscape, wind, cell_size, moisture_row(law.moisture))
        minutes = min(60.0, max(0.05, float(f"{cell_size / fastest / TICKS_PER_CELL:.2g}")))
        return law._changed(minutes_per_tick=minutes)

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
        air = Air(wind, moisture)
        beds = self.beds_in(air)
        spread = self.bed.spread(ground.landscape, wind, self._damp(air), ground.cell_size, beds=_response(beds))
        made = travel(spread.head, spread.direction, spread.length_to_breadth, ground.cell_size)
        return air.replace(terms=Travel(beds, made))

    def head_at(self, state: WorldState, cell: Tensor) -> Spread:
        """Return the behaviour of the fire's head in some cells now, float32 [B, 1, n] each; cell is int64 [B, n]."""
        spread = self.spread_at(state.ground, state.air, in_all(cell, state.cells[0].numel()).flatten())
        return spread.each(lambda of: of.reshape(len(cell), 1, cell.shape[1]))

    def beds_in(self, air: Air) -> Beds | None:
        """Return the response of each fuel model in some air, see ``FuelBed.beds``."""
        return None if self.bed.table is None else Beds(**vars(self.bed.beds(self._damp(air))))

    def spread_at(self, ground: Ground, air: Air, cell: Tensor) -> Spread:
        """Return the behaviour of the fire's head in some cells, float32 [1, 1, N] each.

        Args:
            ground: Of the worlds.
            air: Of the worlds.
            cell: Flat indices in [B, H, W], int64 [N]; numbers depend on the batch unless N fills vectors, see
                ``arrays.listing``.
        """
        cell, landscape, wind, size = cell[None], ground.landscape, air.wind, ground.cell_size
        world = cell.div(ground.alpha[0].numel(), rounding_mode="floor")
        places = wind[0, 0].numel()  # of one wind, or of each cell's
        first = 2 * world if places == 1 else world * places + cell
        wind = torch.stack([wind.flatten()[first + part * places] for part in (0, 1)], dim=1)[:, :, None]
        rise = gradient_at(landscape.elevation, landscape.cover, size, cell)[:, :, None]
        beds = _response(terms_of(air).beds)
        return self.bed.spread(listed(landscape, cell), wind, self._damp(air), size, rise, world=world, beds=beds)

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
        q = reached.to(torch.float32)
        q = q if self.beta == 0.0 else torch.maximum(q, self.spontaneous(state))
        after = self.tick_with(state, u, ticks_now, q)
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
        rise = gradient_at(state.landscape.elevation, state.cover, size, beside.cell)[:, :, None]
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


def _response(beds: Beds | None) -> BedResponse | None:
    return None if beds is None else BedResponse(**vars(beds))


def _log_normal(u: Tensor, variation: float) -> Tensor:
    """Return log-normal factors of median 1 and a coefficient of variation, from uniform draws in [0, 1)."""
    return torch.exp(
        log_deviation(variation) * math.sqrt(2.0) * torch.erfinv((2.0 * u - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6))
    )
