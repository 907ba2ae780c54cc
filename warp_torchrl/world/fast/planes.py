"""Whole maps in bytes, and neighbours as slices of one row: the road for any automaton of the two laws."""

import torch
from torch import Tensor
from torch.compiler import is_compiling

from warp_torchrl.world.fast.bytes import (
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
from warp_torchrl.world.fast.join import in_place
from warp_torchrl.world.fast.rows import expected_from_rows, probability_from_rows
from warp_torchrl.world.fast.table import probability_by_pattern
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.law import in_finer_time
from warp_torchrl.world.state import EMBER, FIRST_FIRE, OLDEST, WorldState, is_burning
from warp_torchrl.world.terrain.landscape import holds_trees


def tick(fire: Fire, state: WorldState, u: Tensor, due: Tensor) -> WorldState:
    """Return what ``Fire.tick`` does."""
    cells = state.cells
    q = ignition_probability(fire, state)
    grows = None
    if fire.growth:
        leaves = look_up(fire.growing(), cells).mul_(1.0 - q)
        grows = ~below(u, torch.sub(1.0, leaves, out=leaves))  # u < 1: none grows where p is 0
    if fire.p_regrow > 0.0:
        bare = equal(cells, 0) & holds_trees(state.cover) & ~as_mask(byte(state.firebreak))
        regrows = bare & below(u, in_finer_time(fire.p_regrow, fire.ticks_per_stage))
        grows = regrows if grows is None else grows | regrows
    state, due_cells = age_fires(fire, state, due), byte(due)[:, None, None]
    ignite = byte(below(u, q)) * due_cells
    after = choose(ignite, FIRST_FIRE, state.cells)
    if grows is not None:
        after += byte(grows) * due_cells
    waited = None if state.stage_age is None else zero_where(ignite, state.stage_age)
    return state.replace(
        cells=to_uint8(after),
        age=to_uint8(choose(ignite, cells, state.age)),
        stage_age=waited if waited is None else to_uint8(waited),
    )


def age_fires(fire: Fire, state: WorldState, due: Tensor) -> WorldState:
    """Return the worlds after a tick, where it is due, that ignites nothing and lets nothing grow.

    What it may yet ignite, ``cells``, ``age`` and ``stage_age``, is ``to_int32``.
    """
    cells, due_cells = to_int32(state.cells), byte(due)[:, None, None]
    stage_ends, waited = byte(is_burning(cells)) * due_cells, None
    if state.stage_age is not None:
        waited = to_int32(state.stage_age) + stage_ends
        stage_ends = byte(equal(waited, fire.ticks_per_stage))
        waited = zero_where(stage_ends, waited)
    after = cells + stage_ends
    to_ash = byte(equal(after, EMBER + 1))
    return state.replace(
        cells=after.bitwise_and_(EMBER),
        age=zero_where(to_ash, state.age),
        stage_age=waited,
        burned=view_as(state.burned, byte(state.burned) | to_ash),
        wet=to_uint8(to_int32(state.wet) - byte(at_least(state.wet, 1)) * due_cells),
        tick=state.tick + due,
    )


def ignition_probability(fire: Fire, state: WorldState) -> Tensor:
    """Return what ``Fire.ignition_probability`` does."""
    spread = _spread_probability(fire, state)
    if fire.beta == 0.0:
        return spread
    spontaneous = look_up(fire.lightning(state.cells[0].numel()), state.cells)
    spontaneous.mul_(number(is_fuel(fire, state) & above(state.alpha, 0.0)))
    return (1.0 - spontaneous).mul_(spread).add_(spontaneous)


def expected_ignitions(fire: Fire, state: WorldState) -> Tensor:
    """Return what ``Fire.expected_ignitions`` does."""
    expected = expected_from_rows(
        in_place(fire.law), _susceptible(fire, state), fire.gain_in(state), state.ground.slope, fire.directions
    )
    return expected * number(spreads(fire, state))


def spreads(fire: Fire, state: WorldState) -> Tensor:
    """Return what ``Fire.spreads`` does."""
    return between(state.cells, FIRST_FIRE, fire.last_spreading)


def is_fuel(fire: Fire, state: WorldState) -> Tensor:
    """Return what ``Fire.is_fuel`` does."""
    return between(state.cells, fire.youngest_fuel, OLDEST) & equal(state.wet, 0)


def _spread_probability(fire: Fire, state: WorldState) -> Tensor:
    if state.air.table is not None and not is_compiling():  # a look-up costs more than what it spares there
        kind = (state.cover + 1) * byte(is_fuel(fire, state))
        return probability_by_pattern(state.air.table, spreads(fire, state), kind)
    return probability_from_rows(
        in_place(fire.law),
        spreads(fire, state),
        _susceptible(fire, state),
        fire.gain_in(state),
        state.ground.slope,
        fire.directions,
    )


def _susceptible(fire: Fire, state: WorldState) -> Tensor:
    return in_place(fire.law).susceptibility(state.alpha) * number(is_fuel(fire, state))
