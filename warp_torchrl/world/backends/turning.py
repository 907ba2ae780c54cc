"""Law ``rate`` in another air, at the trees beside the fire alone: bit for bit what ``RateFire.in_air`` does."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import above
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.listing import flat_cells
from warp_torchrl.world.backends.band import Band, band_of, of_world, padded
from warp_torchrl.world.backends.planes import is_fuel, spreads
from warp_torchrl.world.law.arrivals import RATE, Arrivals, arrivals_in, is_waiting, metric_at
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER, NOWHERE, differ, least_ratio, since, until
from warp_torchrl.world.state.state import Air, WorldState


def in_air(fire: RateFire, state: WorldState, air: Air) -> WorldState:
    """Return worlds in another air; see ``arrivals.in_air``.

    Args:
        fire: The automaton.
        state: The worlds.
        air: The other air.
    """
    burns, fuel = spreads(fire, state), is_fuel(fire, state) & above(state.alpha, 0.0)
    kept, now = arrivals_in(state), fire.now(state)
    waits = is_waiting(kept, now, fuel)
    trees = band_of(flat_cells(waits | (grow(burns) & fuel)), state, burns, fuel)
    metric_at(state.ground, air, flat_cells(grow(burns | waits)))  # at once all that the next tick needs
    before, after = (metric_at(state.ground, each, trees.cell) for each in (state.air, air))
    changes = differ(before, after)

    minutes, origin = kept.minutes.flatten().clone(), kept.origin.flatten().clone()
    times = minutes.index_select(0, trees.cell)
    around = _about(torch.where(burns | waits, kept.minutes, NEVER), NEVER, trees)
    comes = until(times, of_world(now, trees.cell, state), around, before, after)
    comes = torch.where(_about(burns, 0, trees).any(0), comes, NEVER)
    which = (waits.flatten().index_select(0, trees.cell) & changes).nonzero()[:, 0]
    _put(minutes, trees.cell, comes, which)
    _put(origin, trees.cell, torch.where(comes == NEVER, NOWHERE, trees.own), which)

    ratio = torch.where(changes, least_ratio(before, after), 1.0)
    ratios = torch.ones_like(kept.minutes).flatten().scatter_(0, trees.cell, ratio).view_as(fuel)
    turned = torch.zeros_like(fuel).flatten().scatter_(0, trees.cell, changes).view_as(fuel)
    sources = band_of(flat_cells(burns & grow(turned)), state, burns, fuel)
    times, least = minutes.index_select(0, sources.cell), _about(ratios, torch.inf, sources).amin(0)
    minutes.index_copy_(0, sources.cell, since(times, of_world(now, sources.cell, state), least))
    origin.index_copy_(0, sources.cell, sources.own)
    arrivals = Arrivals(minutes.view_as(kept.minutes), origin.view_as(kept.origin))
    return state.replace(air=air).with_planes(RATE, arrivals)


def _about(plane: Tensor, beyond: float, band: Band) -> Tensor:
    """Return what a plane [B, H, W] holds in the neighbours of a band's cells, [8, N]."""
    return padded(plane, beyond).index_select(0, band.around.flatten()).view(8, -1)


def _put(plane: Tensor, cell: Tensor, values: Tensor, which: Tensor) -> None:
    """Put some of the values into a plane, flat."""
    plane.index_copy_(0, cell.index_select(0, which), values.index_select(0, which))
