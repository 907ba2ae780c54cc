"""Times of arrival, the planes that law ``rate`` keeps in its worlds, and the terms that they follow from."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import grow, neighbours
from warp_torchrl.world.law.cells import is_burning, is_tree
from warp_torchrl.world.law.travel import (
    NEVER,
    NOWHERE,
    Metric,
    Places,
    arrival,
    differ,
    kindling,
    least_ratio,
    since,
    until,
)
from warp_torchrl.world.state.state import Air, Ground, WorldState

RATE = "rate"
"""The law's name, under which its worlds hold ``Arrivals``."""
_OTHER_LAW = "the worlds must be those of a fire with rates of spread"


@dataclass(eq=False, repr=False)
class Paces(Batch):
    """What the law makes of ground."""

    pace: Tensor  # float32 [B,H,W], factor on the fire's times in each cell


@dataclass(eq=False, repr=False)
class Beds(Batch):
    """Response of each fuel model in each world, see ``BedResponse`` and ``FuelBed.beds``."""

    rate: Tensor  # float32 [B,F]
    heat: Tensor  # float32 [B,F]
    wind_scale: Tensor  # float32 [B,F]
    wind_power: Tensor  # float32 [B,F]
    slope_scale: Tensor  # float32 [B,F]
    top_wind: Tensor  # float32 [B,F]


@dataclass(eq=False, repr=False)
class Terms(Batch, ABC):
    """What the law makes of a wind: a, w_east and w_north, see ``travel.travel`` [minutes a cell]."""

    beds: Beds | None  # None of the Canadian system

    @abstractmethod
    def on(self, ground: Ground, air: Air) -> Tensor:
        """Return them on some ground in the air that has these terms, float32 [B, 3, H, W]."""

    @abstractmethod
    def at(self, ground: Ground, air: Air, cell: Tensor) -> Tensor:
        """Return them in some cells, int64 [N], flat indices in [B, H, W]; float32 [3, N]."""


@dataclass(eq=False, repr=False)
class Travel(Terms):
    """Terms that are kept, made once for all cells."""

    travel: Tensor  # float32 [B,3,H,W]

    def on(self, ground: Ground, air: Air) -> Tensor:
        """See ``Terms``."""
        return self.travel

    def at(self, ground: Ground, air: Air, cell: Tensor) -> Tensor:
        """See ``Terms``."""
        count = self.travel[0, 0].numel()
        first = cell + 2 * count * cell.div(count, rounding_mode="floor")
        flat = self.travel.flatten()
        return torch.stack([flat.index_select(0, first + part * count) for part in range(3)])


@dataclass(eq=False, repr=False)
class Arrivals(Batch):
    """When the fire reaches each cell at the present rates of spread, and where it comes from."""

    minutes: Tensor  # float32 [B,H,W], since ignition; of cells that burn and their neighbours, else ``travel.NEVER``
    origin: Tensor  # int32 [B,H,W], flat index of the cell that it came from on a straight way, or -1


def arrivals_in(state: WorldState) -> Arrivals:
    """Return the arrivals in worlds under law ``rate``."""
    return state.planes(RATE, Arrivals)


def pace_on(ground: Ground) -> Tensor:
    """Return the factor on the fire's times on some ground, float32 [B, H, W].

    Raises:
        ValueError: If the ground is of another law.
    """
    if not isinstance(ground.terms, Paces):
        raise ValueError(_OTHER_LAW)
    return ground.terms.pace


def metric(ground: Ground, air: Air) -> Metric:
    """Return a, w_east and w_north of the fire on some ground in some air, float32 [B, H, W] each [minutes a cell].

    Raises:
        ValueError: If they are of another law.
    """
    made, pace = terms_of(air).on(ground, air), pace_on(ground)
    return made[:, 0] * pace, made[:, 1] * pace, made[:, 2] * pace


def metric_at(ground: Ground, air: Air, cell: Tensor) -> Metric:
    """Return what ``metric`` does in some cells, int64 [N], flat indices in [B, H, W]; float32 [N] each."""
    slowness, east, north = terms_of(air).at(ground, air, cell) * pace_on(ground).flatten().index_select(0, cell)
    return slowness, east, north


def terms_of(air: Air) -> Terms:
    """Return what the law makes of a wind.

    Raises:
        ValueError: If it is of another law.
    """
    if not isinstance(air.terms, Terms):
        raise ValueError(_OTHER_LAW)
    return air.terms


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

    The trees beside it have times of their own from then on, which hold until the fire comes earlier; these trees and
    the burning cells beside them are origins. Where rates stay, so do times and origins.

    Args:
        state: The worlds.
        air: The other air.
        now: When it changes, float32 [B, 1, 1] [minutes].
        spreads: The burning cells that ignite others, bool [B, H, W].
        fuel: The trees that can ignite, bool [B, H, W].
    """
    kept, before, after = arrivals_in(state), metric(state.ground, state.air), metric(state.ground, air)
    waits, changes = is_waiting(kept, now, fuel), differ(before, after)
    around = neighbours(torch.where(spreads | waits, kept.minutes, NEVER), NEVER)
    comes = until(kept.minutes, now, around, before, after)
    comes = torch.where(grow(spreads), comes, NEVER)
    ratio = neighbours(torch.where(fuel & changes, least_ratio(before, after), 1.0), torch.inf)
    begun = since(kept.minutes, now, ratio.amin(0))
    sends, waits = spreads & grow(fuel & changes), waits & changes
    minutes = torch.where(sends, begun, torch.where(waits, comes, kept.minutes))
    origin = torch.where(sends | waits, own_cell(state.cells), kept.origin)
    origin = torch.where(waits & (comes == NEVER), NOWHERE, origin)
    return state.replace(air=air).with_planes(RATE, Arrivals(minutes, origin))


def is_waiting(kept: Arrivals, now: Tensor, fuel: Tensor) -> Tensor:
    """Return the trees that the fire has not reached yet and comes to, bool [B, H, W]."""
    return fuel & (kept.minutes > now) & (kept.minutes < NEVER / 2)


def beside(spreads: Tensor, fuel: Tensor, kindled: Tensor) -> Tensor:
    """Return the cells of fuel beside those that spread fire, or that kindle their neighbours, bool [B, H, W]."""
    return grow(spreads | kindled) & fuel


def kindled(state: WorldState, now: Tensor, fuel: Tensor) -> Tensor:
    """Return the trees that the fire is about to reach, bool [B, H, W]; the arguments are those of ``in_air``."""
    kept, (slowness, _, _) = arrivals_in(state), metric(state.ground, state.air)
    return is_waiting(kept, now, fuel) & (kindling(kept.minutes, slowness) <= now)


def sources(state: WorldState, now: Tensor, spreads: Tensor, fuel: Tensor) -> Tensor:
    """Return the times from which those of neighbours follow, float32 [B, H, W]; else ``NEVER``.

    They are those of cells that burn, and of trees that the fire has not reached yet. The arguments are those of
    ``in_air``.
    """
    minutes = arrivals_in(state).minutes
    return torch.where(spreads | (fuel & (minutes > now)), minutes, NEVER)


def known(state: WorldState, times: Tensor) -> Tensor:
    """Return when the fire reached the cells that burn or have burned, else ``sources``, float32 [B, H, W]."""
    return torch.where(is_tree(state.cells), times, arrivals_in(state).minutes)


def next_arrivals(state: WorldState, times: Tensor, spreads: Tensor, beside: Tensor, earliest: Tensor) -> Arrivals:
    """Return when the fire reaches some cells that can ignite, else ``NEVER``.

    Args:
        state: The worlds.
        times: When it reaches their neighbours, float32 [B, H, W] [minutes]; ``NEVER`` where it does not.
        spreads: The burning cells that ignite others, bool [B, H, W].
        beside: The cells, bool [B, H, W].
        earliest: What counts as late: a cell that has a time only after that takes it, float32 [B, 1, 1] [minutes].
    """
    at_origin, (row, column) = known(state, times).flatten(1), _rows_and_columns(state.cells)
    kept, own = arrivals_in(state), own_cell(state.cells)

    def time_of(origin: Tensor) -> Tensor:
        return at_origin.gather(1, origin.flatten(1).to(torch.int64)).view(origin.shape)

    places = Places(row, column, state.cells.shape[2], time_of)
    around = neighbours(times, NEVER), neighbours(kept.origin, NOWHERE)
    minutes, origin = arrival(*around, metric(state.ground, state.air), places)
    minutes = torch.maximum(minutes, earliest)
    holds = (kept.origin == own) & (times <= minutes) & grow(spreads)
    minutes, origin = torch.where(holds, times, minutes), torch.where(holds, own, origin)
    return Arrivals(torch.where(beside, minutes, NEVER), torch.where(beside, origin, NOWHERE))


def own_cell(cells: Tensor) -> Tensor:
    """Return the flat index of each cell, int32 [B, H, W]."""
    row, column = _rows_and_columns(cells)
    return row * cells.shape[2] + column


def _rows_and_columns(cells: Tensor) -> tuple[Tensor, Tensor]:
    row = torch.arange(cells.shape[1], dtype=torch.int32, device=cells.device)[:, None]
    column = torch.arange(cells.shape[2], dtype=torch.int32, device=cells.device)
    return row.expand(cells.shape), column.expand(cells.shape)
