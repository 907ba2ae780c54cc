"""The one entry to the fast backends, and the place where one is chosen.

A backend computes what the law itself does (``world.law.law``), to the bit. An automaton that none covers takes
the reference, the law in plain tensor operations, on any device.
"""

from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Batched
from warp_torchrl.world.arrays.bytes import number
from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.backends.band import AtBand
from warp_torchrl.world.backends.edge import AtEdge
from warp_torchrl.world.backends.on_demand import on_demand
from warp_torchrl.world.backends.planes import WholeMaps
from warp_torchrl.world.backends.table import Tabled, pattern_table
from warp_torchrl.world.backends.turning import in_air
from warp_torchrl.world.law.arrivals import RATE
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.fire import Fire, Gains, Slopes
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import Air, Forecast, Ground, WorldState

COVERED = (Fire, HazardFire)
"""The automata that the fast backends compute; a subclass may have other rules, and takes the reference."""


class Backend(Protocol):
    """One way to compute a law."""

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return the worlds after one tick of the fire with their own draws, in the worlds that tick now, bool [B]."""
        ...

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return the expected ignitions and the ignition probability of each cell, float32 [B, H, W] each."""
        ...


class Reference:
    """The law itself, for any automaton and on any device.

    Args:
        fire: The automaton.
    """

    def __init__(self, fire: Automaton) -> None:
        self.fire = fire

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """See ``Backend``."""
        return self.fire.tick(
            state, uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:])), ticks_now
        )

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """See ``Backend``."""
        return self.fire.expected_ignitions(state), self.fire.ignition_probability(state)


def fastest(fire: Automaton, device: torch.device) -> Backend:
    """Return the fastest backend of an automaton on a device.

    A CPU computes a tick at the fire's edge alone where trees neither grow nor ignite by themselves, unless whole maps
    are compiled.
    """
    on_cpu = _may_read(device)
    if type(fire) is RateFire and on_cpu:
        return AtBand(fire)
    if not isinstance(fire, Fire) or type(fire) not in COVERED:
        return Reference(fire)
    spreads_alone = not fire.growth and fire.beta == 0.0 and fire.p_regrow == 0.0
    return AtEdge(fire) if spreads_alone and on_cpu else WholeMaps(fire)


def _may_read(device: torch.device) -> bool:
    return needs_no_sync(device) and not is_fused()


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
    if type(fire) is RateFire and fire.wind_wanders and _may_read(wind.device):
        return on_demand(fire, wind, moisture, ground)
    made = fire.air(wind, moisture, ground)
    if not isinstance(fire, Fire) or type(fire) not in COVERED:
        return made
    if isinstance(ground.terms, Slopes) or not isinstance(made.terms, Gains):
        return made
    return made.replace(terms=Tabled(made.terms.gain, pattern_table(fire, made.terms.gain)))


def in_wind(fire: Automaton, state: WorldState, wind: Tensor, moisture: Tensor | None) -> WorldState:
    """Return worlds in another wind and moisture; the arguments are those of ``Automaton.air``.

    Under law ``rate``, whose air is dear, a CPU makes that of the worlds alone where it differs.
    """
    old = state.air
    if not isinstance(fire, RateFire) or not _may_read(wind.device):
        return fire.in_air(state, air(fire, wind, moisture, state.ground))
    differs = (wind != old.wind).flatten(1).any(dim=1)
    if moisture is not None and old.moisture is not None:
        differs |= (moisture.nan_to_num(-1.0) != old.moisture.nan_to_num(-1.0)).any(dim=1)  # NaN differs from itself
    index = differs.nonzero()[:, 0]
    if not len(index):
        return state
    turned = in_air if type(fire) is RateFire else type(fire).in_air
    if len(index) == len(differs):  # no rows need be copied
        return turned(fire, state, air(fire, wind, moisture, state.ground))
    rows = state[index]
    damp = None if moisture is None else moisture[index]
    changed = turned(fire, rows, air(fire, wind[index], damp, rows.ground)).leaves()
    leaves = state.leaves()
    put = {name: leaves[name].index_copy(0, index, leaf) for name, leaf in changed.items() if _follows_air(name)}
    return state.with_leaves({**leaves, **put})


def _follows_air(name: str) -> bool:
    return name.startswith(("air.", f"extras.{RATE}."))


def advance_rows(state: Batched, ticks_now: Tensor, advance: Callable[[Batched, Tensor], Batched]) -> Batched:
    """Return ``advance(state, ticks_now)``, on a CPU computed for the worlds that tick alone, if they are the fewer.

    The others stay as they are. Which ones they are is read back from the device.
    """
    if not _may_read(ticks_now.device):
        return advance(state, ticks_now)
    index = ticks_now.nonzero()[:, 0]
    if 2 * len(index) > len(ticks_now):  # to copy their rows takes longer
        return advance(state, ticks_now)
    if not len(index):
        return state
    rows = state[index]
    before, after, leaves = rows.leaves(), advance(rows, ticks_now[index]).leaves(), state.leaves()
    changed = [name for name, leaf in after.items() if leaf is not before[name]]
    return state.with_leaves({**leaves, **{name: leaves[name].index_copy(0, index, after[name]) for name in changed}})


def advance_any(state: Batched, which: Tensor, advance: Callable[[Batched], Batched]) -> Batched:
    """Return ``advance(state)``, which changes nothing where no mark is set; on a CPU the state itself if none is.

    It is for what costs less in all worlds than to copy those that it changes.
    """
    return state if _may_read(which.device) and not which.any() else advance(state)
