"""Whole maps in bytes, and neighbours as slices of one row: the backend for any automaton of the two laws."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import (
    above,
    as_mask,
    at_least,
    below,
    between,
    byte,
    choose,
    equal,
    look_up,
    number,
    to_int32,
    to_uint8,
    view_as,
    zero_where,
)
from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.backends.join import in_place
from warp_torchrl.world.backends.rows import expected_from_rows, probability_from_rows
from warp_torchrl.world.backends.table import probability_by_pattern, table_in
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.fire import Fire, slope_in
from warp_torchrl.world.law.law import in_finer_time
from warp_torchrl.world.state.cells import holds_trees, is_burning
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, WorldState


class WholeMaps:
    """Ticks and forecasts from whole maps.

    Args:
        fire: The automaton.
    """

    def __init__(self, fire: Fire) -> None:
        self.fire = fire

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return the worlds after one tick of the fire with their own draws, in the worlds that tick now, bool [B]."""
        fire, cells = self.fire, state.cells
        u = uniform(state.key, state.tick, Stream.FIRE, tuple(cells.shape[1:]))
        q = self.ignition_probability(state)
        grows = None
        if fire.growth:
            leaves = look_up(fire.growing(), cells).mul_(1.0 - q)
            grows = ~below(u, torch.sub(1.0, leaves, out=leaves))  # u < 1: none grows where p is 0
        if fire.p_regrow > 0.0:
            bare = equal(cells, 0) & holds_trees(state.cover) & ~as_mask(byte(state.firebreak))
            regrows = bare & below(u, in_finer_time(fire.p_regrow, fire.ticks_per_stage))
            grows = regrows if grows is None else grows | regrows
        state, ticking = age_fires(fire, state, ticks_now), byte(ticks_now)[:, None, None]
        ignite = byte(below(u, q)) * ticking
        after = choose(ignite, FIRST_FIRE, state.cells)
        if grows is not None:
            after += byte(grows) * ticking
        waited = None if state.stage_age is None else zero_where(ignite, state.stage_age)
        return state.replace(
            cells=to_uint8(after),
            age=to_uint8(choose(ignite, cells, state.age)),
            stage_age=waited if waited is None else to_uint8(waited),
        )

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return what ``Fire.expected_ignitions`` and ``Fire.ignition_probability`` do, float32 [B, H, W] each."""
        fire = self.fire
        expected = expected_from_rows(
            in_place(fire.law), self._susceptible(state), fire.gain_in(state), slope_in(state), fire.directions
        )
        return expected * number(spreads(fire, state)), self.ignition_probability(state)

    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return what ``Fire.ignition_probability`` does."""
        spread = self._spread_probability(state)
        if self.fire.beta == 0.0:
            return spread
        spontaneous = look_up(self.fire.lightning(state.cells[0].numel()), state.cells)
        spontaneous.mul_(number(is_fuel(self.fire, state) & above(state.alpha, 0.0)))
        return (1.0 - spontaneous).mul_(spread).add_(spontaneous)

    def _spread_probability(self, state: WorldState) -> Tensor:
        fire = self.fire
        table = table_in(state)
        if table is not None and not is_fused():  # a look-up costs more than what it spares there
            kind = (state.cover + 1) * byte(is_fuel(fire, state))
            return probability_by_pattern(table, spreads(fire, state), kind)
        return probability_from_rows(
            in_place(fire.law),
            spreads(fire, state),
            self._susceptible(state),
            fire.gain_in(state),
            slope_in(state),
            fire.directions,
        )

    def _susceptible(self, state: WorldState) -> Tensor:
        return in_place(self.fire.law).susceptibility(state.alpha) * number(is_fuel(self.fire, state))


def age_fires(fire: Automaton, state: WorldState, ticks_now: Tensor) -> WorldState:
    """Return the worlds after a tick, in those that tick now, that ignites nothing and lets nothing grow.

    What it may yet ignite, ``cells``, ``age`` and ``stage_age``, is ``to_int32``.
    """
    cells, ticking = to_int32(state.cells), byte(ticks_now)[:, None, None]
    stage_ends, waited = byte(is_burning(cells)) * ticking, None
    if state.stage_age is not None:
        waited = to_int32(state.stage_age) + stage_ends
        stage_ends = stage_ends * byte(equal(waited, fire.ticks_per_stage))
        waited = zero_where(stage_ends, waited)
    after = cells + stage_ends
    to_ash = byte(equal(after, EMBER + 1))
    return state.replace(
        cells=after.bitwise_and_(EMBER),
        age=zero_where(to_ash, state.age),
        stage_age=waited,
        burned=view_as(state.burned, byte(state.burned) | to_ash),
        wet=to_uint8(to_int32(state.wet) - byte(at_least(state.wet, 1)) * ticking),
        tick=state.tick + ticks_now,
    )


def spreads(fire: Automaton, state: WorldState) -> Tensor:
    """Return what ``Automaton.spreads`` does."""
    return between(state.cells, FIRST_FIRE, fire.last_spreading)


def is_fuel(fire: Automaton, state: WorldState) -> Tensor:
    """Return what ``Automaton.is_fuel`` does."""
    return between(state.cells, fire.youngest_fuel, OLDEST) & equal(state.wet, 0)
