"""Times of arrival, the planes that law ``rate`` keeps in its worlds, and the terms that they follow from."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import grow, neighbour_in, neighbours
from warp_torchrl.world.law.cells import is_burning, is_tree
from warp_torchrl.world.law.travel import NEVER, NOWHERE, Metric, Places, arrival, at_other_rates, rate_from
from warp_torchrl.world.state.state import Air, Ground, WorldState

RATE = "rate"
"""The law's name, under which its worlds hold ``Arrivals``."""


@dataclass(eq=False, repr=False)
class Paces(Batch):
    """What the law makes of ground."""

    pace: Tensor  # float32 [B,H,W], factor on the fire's times in each cell


@dataclass(eq=False, repr=False)
class Travel(Batch):
    """What the law makes of a wind."""

    travel: Tensor  # float32 [B,3,H,W], a, w_east and w_north, see ``travel.travel`` [minutes a cell]


@dataclass(eq=False, repr=False)
class Arrivals(Batch):
    """When the fire reaches each cell at the present rates of spread, and where it comes from."""

    minutes: Tensor  # float32 [B,H,W], since ignition; of cells that burn and their neighbours, else ``travel.NEVER``
    origin: Tensor  # int32 [B,H,W], flat index of the cell that it came from on a straight way, or -1


def arrivals_in(state: WorldState) -> Arrivals:
    """Return the arrivals in worlds under law ``rate``."""
    return state.planes(RATE, Arrivals)


def terms_of(ground: Ground, air: Air) -> tuple[Tensor, Tensor]:
    """Return the travel in some air and the pace on some ground, float32 [B, 3, H, W] and [B, H, W].

    Raises:
        ValueError: If they are of another law.
    """
    if not isinstance(air.terms, Travel) or not isinstance(ground.terms, Paces):
        raise ValueError("the worlds must be those of a fire with rates of spread")
    return air.terms.travel, ground.terms.pace


def metric(ground: Ground, air: Air) -> Metric:
    """Return a, w_east and w_north of the fire on some ground in some air, float32 [B, H, W] each [minutes a cell]."""
    made, pace = terms_of(ground, air)
    return made[:, 0] * pace, made[:, 1] * pace, made[:, 2] * pace


def started(state: WorldState) -> WorldState:
    """Return worlds whose fires have reached the cells that burn at minute 0."""
    burning = is_burning(state.cells)
    minutes = torch.where(burning, 0.0, NEVER)
    return state.with_planes(RATE, Arrivals(minutes, torch.where(burning, own_cell(state.cells), NOWHERE)))


def lit(state: WorldState, where: Tensor, now: Tensor) -> WorldState:
    """Return worlds whose fires have reached some cells, bool [B, H, W], now [minutes], each from itself."""
    kept = arrivals_in(state)
    minutes = torch.where(where, now, kept.minutes)
    return state.with_planes(RATE, Arrivals(minutes, torch.where(where, own_cell(state.cells), kept.origin)))


def in_air(state: WorldState, air: Air, now: Tensor, spreads: Tensor, fuel: Tensor) -> WorldState:
    """Return worlds in another air: the fire has gone as far as it has, and spreads at the new rates.

    What a cell has waited, or has to wait, changes by the ratio of the mean rates to or from its neighbours. Every
    burning cell is an origin from now on.

    Args:
        state: The worlds.
        air: The other air.
        now: When it changes, float32 [B, 1, 1] [minutes].
        spreads: The burning cells that ignite others, bool [B, H, W].
        fuel: The trees that can ignite, bool [B, H, W].
    """
    before, after = (_mean_rate(metric(state.ground, each), spreads, fuel) for each in (state.air, air))
    minutes = at_other_rates(arrivals_in(state).minutes, now, before, after)
    origin = torch.where(is_burning(state.cells), own_cell(state.cells), NOWHERE)
    return state.replace(air=air).with_planes(RATE, Arrivals(minutes, origin))


def beside(spreads: Tensor, fuel: Tensor) -> Tensor:
    """Return the cells of fuel beside those that spread fire, bool [B, H, W] as both are."""
    return grow(spreads) & fuel


def sources(state: WorldState, now: Tensor, spreads: Tensor, fuel: Tensor) -> Tensor:
    """Return the times from which those of neighbours follow, float32 [B, H, W]; else ``NEVER``.

    They are those of cells that burn, and of trees that the fire has not reached yet. The arguments are those of
    ``in_air``.
    """
    minutes = arrivals_in(state).minutes
    return torch.where(spreads | (fuel & (minutes > now)), minutes, NEVER)


def reached(state: WorldState) -> Tensor:
    """Return when the fire reached the cells that burn or have burned, else ``NEVER``, float32 [B, H, W]."""
    return torch.where(is_tree(state.cells), NEVER, arrivals_in(state).minutes)


def next_arrivals(state: WorldState, times: Tensor, beside: Tensor) -> Arrivals:
    """Return when the fire reaches some cells that can ignite, else ``NEVER``.

    Args:
        state: The worlds.
        times: When it reaches their neighbours, float32 [B, H, W] [minutes]; ``NEVER`` where it does not.
        beside: The cells, bool [B, H, W].
    """
    known, (row, column) = reached(state).flatten(1), _rows_and_columns(state.cells)

    def time_of(origin: Tensor) -> Tensor:
        return known.gather(1, origin.flatten(1).to(torch.int64)).view(origin.shape)

    places = Places(row, column, state.cells.shape[2], time_of)
    around = neighbours(times, NEVER), neighbours(arrivals_in(state).origin, NOWHERE)
    minutes, origin = arrival(*around, metric(state.ground, state.air), places)
    return Arrivals(torch.where(beside, minutes, NEVER), torch.where(beside, origin, NOWHERE))


def own_cell(cells: Tensor) -> Tensor:
    """Return the flat index of each cell, int32 [B, H, W]."""
    row, column = _rows_and_columns(cells)
    return row * cells.shape[2] + column


def _mean_rate(rates: Metric, spreads: Tensor, fuel: Tensor) -> Tensor:
    """Return the sum of the rates from each burning cell to fuel, or from burning cells into fuel [B, H, W]."""
    burning, trees = spreads.to(torch.float32), fuel.to(torch.float32)
    into, out = torch.zeros_like(trees), torch.zeros_like(trees)
    for direction in range(8):
        rate = rate_from(direction, rates)
        into = into + rate * neighbour_in(direction, burning)
        out = out + neighbour_in((direction + 4) % 8, rate * trees)
    return torch.where(spreads, out, into * trees)


def _rows_and_columns(cells: Tensor) -> tuple[Tensor, Tensor]:
    row = torch.arange(cells.shape[1], dtype=torch.int32, device=cells.device)[:, None]
    column = torch.arange(cells.shape[2], dtype=torch.int32, device=cells.device)
    return row.expand(cells.shape), column.expand(cells.shape)
