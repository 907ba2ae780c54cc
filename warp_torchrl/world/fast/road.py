"""The one entry to the fast roads, and the place where one is chosen.

A road computes what the law's page does (``warp_torchrl.world.law``), to the bit. An automaton that none covers takes
the page itself, on any device.
"""

from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor
from torch.compiler import is_compiling

from warp_torchrl.device import reads_freely
from warp_torchrl.world.automaton import Automaton
from warp_torchrl.world.fast.band import AtBand
from warp_torchrl.world.fast.bytes import number
from warp_torchrl.world.fast.edge import AtEdge
from warp_torchrl.world.fast.planes import Planes
from warp_torchrl.world.fast.table import pattern_table
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.hazard import HazardFire
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.rate import RateFire
from warp_torchrl.world.state import Air, Forecast, Ground, WorldState, is_tree

COVERED = (Fire, HazardFire)
"""The automata that the fast roads compute; a subclass may have other rules, and takes the page."""


class Road(Protocol):
    """One way to compute the law's page."""

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return the worlds after one tick of the fire with their own draws, in the worlds that tick now, bool [B]."""
        ...

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return the expected ignitions and the ignition probability of each cell, float32 [B, H, W] each."""
        ...


class Page:
    """The law's page itself, for any automaton and on any device.

    Args:
        fire: The automaton.
    """

    def __init__(self, fire: Automaton) -> None:
        self.fire = fire

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """See ``Road``."""
        return self.fire.tick(
            state, uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:])), ticks_now
        )

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """See ``Road``."""
        return self.fire.expected_ignitions(state), self.fire.ignition_probability(state)


def fastest(fire: Automaton, device: torch.device) -> Road:
    """Return the fastest road of an automaton on a device.

    A CPU computes a tick at the fire's edge alone where trees neither grow nor ignite by themselves, unless whole maps
    are compiled.
    """
    on_cpu = _may_read(device)
    if type(fire) is RateFire and on_cpu:
        return AtBand(fire)
    if not isinstance(fire, Fire) or type(fire) not in COVERED:
        return Page(fire)
    spreads_alone = not fire.growth and fire.beta == 0.0 and fire.p_regrow == 0.0
    return AtEdge(fire) if spreads_alone and on_cpu else Planes(fire)


def _may_read(device: torch.device) -> bool:
    return reads_freely(device) and not is_compiling()


def can_fuse(fire: Automaton) -> bool:
    """Return whether a step of whole worlds may be compiled.

    Under law ``rate`` it may not: its page took minutes to compile, and a CPU's band is faster without.
    """
    return not isinstance(fire, RateFire)


def forecast(fire: Automaton, state: WorldState) -> Forecast:
    """Return what the fire is about to do."""
    expected, probability = fastest(fire, state.cells.device).forecast(state)
    return Forecast(
        expected_ignitions=expected.mul_(0.25).clamp_(max=1.0),
        ignition_probability=probability,
        fuel=state.alpha * number(is_tree(state.cells)),
    )


def air(fire: Automaton, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
    """Return a wind with all that follows from it on some ground; the arguments are those of ``Automaton.air``."""
    made = fire.air(wind, moisture, ground)
    if not isinstance(fire, Fire) or made.gain is None or ground.slope is not None or type(fire) not in COVERED:
        return made
    return made.replace(table=pattern_table(fire, made.gain))


def in_wind(fire: Automaton, state: WorldState, wind: Tensor, moisture: Tensor | None) -> WorldState:
    """Return worlds in another wind and moisture; the arguments are those of ``Automaton.air``.

    Under law ``rate``, whose air is dear, a CPU makes that of the worlds alone where it differs.
    """
    old = state.air
    if old.travel is None or not _may_read(wind.device):
        return fire.in_air(state, air(fire, wind, moisture, state.ground))
    differs = (wind != old.wind).flatten(1).any(dim=1)
    if moisture is not None and old.moisture is not None:
        differs |= (moisture.nan_to_num(-1.0) != old.moisture.nan_to_num(-1.0)).any(dim=1)  # NaN differs from itself
    index = differs.nonzero()[:, 0]
    if not len(index):
        return state
    rows = state[index]
    damp = None if moisture is None else moisture[index]
    changed = fire.in_air(rows, air(fire, wind[index], damp, rows.ground)).leaves()
    leaves = state.leaves()
    put = {name: leaves[name].index_copy(0, index, leaf) for name, leaf in changed.items() if _follows_air(name)}
    return state.with_leaves({**leaves, **put})


def _follows_air(name: str) -> bool:
    return name.startswith(("air.", "arrivals."))


def advance_rows(
    state: WorldState, ticks_now: Tensor, advance: Callable[[WorldState, Tensor], WorldState]
) -> WorldState:
    """Return ``advance(state, ticks_now)``, on a CPU computed for the worlds that tick alone.

    Which ones they are is read back from the device.
    """
    if not _may_read(ticks_now.device):
        return advance(state, ticks_now)
    index = ticks_now.nonzero()[:, 0]
    if len(index) == len(ticks_now):
        return advance(state, ticks_now)
    if not len(index):
        return state
    rows = state[index]
    before, after, leaves = rows.leaves(), advance(rows, ticks_now[index]).leaves(), state.leaves()
    changed = [name for name, leaf in after.items() if leaf is not before[name]]
    return state.with_leaves({**leaves, **{name: leaves[name].index_copy(0, index, after[name]) for name in changed}})


_FLAGS = ("initial", "extinguished", "burned", "firebreak")


def in_bytes(state: WorldState) -> WorldState:
    """Return worlds whose planes of flags are read as uint8, 0 and 1, as functions that are compiled need them."""
    return state.replace(**{name: getattr(state, name).view(torch.uint8) for name in _FLAGS})


def in_flags(state: WorldState) -> WorldState:
    """Return the worlds of ``in_bytes`` as they are elsewhere."""
    return state.replace(**{name: getattr(state, name).view(torch.bool) for name in _FLAGS})
