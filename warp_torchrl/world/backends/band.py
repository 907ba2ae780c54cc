"""Law ``rate`` at the trees beside the fire alone: the backend of a CPU.

Only they have a time of arrival. They are a few cells in a hundred, and times there alone come to the same bits as
those of whole maps. How many they are is read back, which a CPU does for nothing and a CUDA device does not.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.bytes import above, equal, index_put
from warp_torchrl.world.arrays.geometry import places_around
from warp_torchrl.world.arrays.listing import flat_cells
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.backends.planes import age_fires, is_fuel, spreads
from warp_torchrl.world.law.arrivals import RATE, Arrivals, arrivals_in, beside, is_waiting, known, metric_at, sources
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER, NOWHERE, Places, arrival, kindling, rate_from
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState


class AtBand:
    """Ticks and forecasts from the trees beside the fire alone.

    Args:
        fire: The automaton.
    """

    def __init__(self, fire: RateFire) -> None:
        self.fire = fire

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return the worlds after one tick of the fire with their own draws, in the worlds that tick now, bool [B]."""
        fire = self.fire
        if not (fire.growth or fire.beta > 0.0 or fire.p_regrow > 0.0):
            return self._tick_alone(state, ticks_now)
        size = (state.cells.shape[1], state.cells.shape[2])
        u = uniform(state.key, state.tick, Stream.FIRE, size)
        return fire.tick_to(state, u, ticks_now, self.next_arrivals(state))

    def _tick_alone(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return what ``tick`` does where trees neither grow nor ignite by themselves."""
        fire, band, here = self.fire, self._band(state), ticks_now[:, None, None]
        minutes, origin = self._times(state, band)
        ticking = of_world(here, band.cell, state)
        lit = band.cell[ticking & (minutes <= of_world(fire.now(state.replace(tick=state.tick + 1)), band.cell, state))]
        after = self._held(state, _lit(age_fires(fire, state, ticks_now), state.cells, lit))

        before, trees, now = arrivals_in(state), is_tree(state.cells) & here, ticking.nonzero()[:, 0]
        times, origins = torch.where(trees, NEVER, before.minutes), torch.where(trees, NOWHERE, before.origin)
        cell = band.cell.index_select(0, now)
        times = index_put(times, cell, minutes.index_select(0, now))
        return after.with_planes(RATE, Arrivals(times, index_put(origins, cell, origin.index_select(0, now))))

    def _held(self, before: WorldState, after: WorldState) -> WorldState:
        """Return what ``RateFire._held`` does."""
        ends = equal(before.cells, self.fire.last_spreading) & (after.cells != before.cells)
        fuel = is_fuel(self.fire, after) & above(after.alpha, 0.0)
        cell = flat_cells(ends)
        around = places_around(cell, (after.cells.shape[1], after.cells.shape[2]))
        holds = cell[padded(fuel, 0).index_select(0, around.flatten()).view(8, -1).any(0)]
        as_before = {
            name: index_put(getattr(after, name), holds, getattr(before, name).flatten().index_select(0, holds))
            for name in ("cells", "age", "stage_age", "burned")
            if getattr(after, name) is not None
        }
        return after.replace(**as_before)

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return what ``RateFire.expected_ignitions`` and ``RateFire.ignition_probability`` do, float32 [B, H, W]."""
        band = self._band(state)
        return self._expected_ignitions(state, band), self.fire.share_of_tick(state, self._arrivals(state, band))

    def next_arrivals(self, state: WorldState) -> Arrivals:
        """Return what ``RateFire.next_arrivals`` does."""
        return self._arrivals(state, self._band(state))

    def _band(self, state: WorldState) -> "Band":
        burns = spreads(self.fire, state)
        fuel = is_fuel(self.fire, state) & above(state.alpha, 0.0)
        near = beside(burns, fuel, self._kindled(state, fuel))
        return band_of(flat_cells(near), state, burns, fuel)

    def _kindled(self, state: WorldState, fuel: Tensor) -> Tensor:
        """Return what ``arrivals.kindled`` does."""
        kept, now = arrivals_in(state), self.fire.now(state)
        waits = is_waiting(kept, now, fuel)
        cell = flat_cells(waits)
        slowness, _, _ = metric_at(state.ground, state.air, cell)
        soon = kindling(kept.minutes.flatten().index_select(0, cell), slowness) <= of_world(now, cell, state)
        return torch.zeros_like(waits).flatten().scatter_(0, cell, soon).view_as(waits)

    def _arrivals(self, state: WorldState, band: "Band") -> Arrivals:
        minutes, origin = self._times(state, band)
        never = torch.full_like(state.alpha, NEVER)
        nowhere = torch.full_like(state.cells, NOWHERE, dtype=torch.int32)
        return Arrivals(index_put(never, band.cell, minutes), index_put(nowhere, band.cell, origin))

    def _times(self, state: WorldState, band: "Band") -> tuple[Tensor, Tensor]:
        """Return what ``Arrivals`` holds in the cells of a band, float32 and int32 [N]."""
        kept, times = arrivals_in(state), sources(state, self.fire.now(state), band.spreads, band.fuel)
        at_origin = known(state, times).flatten()
        here, own = times.flatten().index_select(0, band.cell), band.own
        around = (padded(times, NEVER), padded(kept.origin, NOWHERE), padded(band.spreads, 0))
        times, origins, burning = (plane.index_select(0, band.around.flatten()).view(8, -1) for plane in around)

        def time_of(origin: Tensor) -> Tensor:
            return at_origin.index_select(0, band.first + origin)

        at = Places(band.row, band.column, state.cells.shape[2], time_of)
        minutes, origin = arrival(times, origins, metric_at(state.ground, state.air, band.cell), at)
        minutes = torch.maximum(minutes, of_world(self.fire.earliest(state), band.cell, state))
        holds = (kept.origin.flatten().index_select(0, band.cell) == own) & (here <= minutes)
        holds &= burning.any(0)
        return torch.where(holds, here, minutes), torch.where(holds, own, origin)

    def _expected_ignitions(self, state: WorldState, band: "Band") -> Tensor:
        burns = padded(band.spreads, 0)
        metric = metric_at(state.ground, state.air, band.cell)
        total = torch.zeros_like(burns, dtype=torch.float32)
        for direction in range(8):
            source = band.around[direction]
            share = (rate_from(direction, metric) * self.fire.minutes).clamp(max=1.0)
            total.scatter_add_(0, source, share * burns.index_select(0, source))
        worlds, height, width = state.cells.shape
        return total.view(worlds, height + 2, width + 2)[:, 1:-1, 1:-1].contiguous()


@dataclass(frozen=True, eq=False)
class Band:
    """Some cells of the worlds, and what is about them."""

    cell: Tensor  # flat index in [B, H, W], int64 [N]
    first: Tensor  # flat index of the first cell of the same world, int64 [N]
    row: Tensor  # int32 [N]
    column: Tensor  # int32 [N]
    around: Tensor  # flat index of each neighbour in maps with a margin of one cell, int64 [8, N]
    spreads: Tensor  # the burning cells that ignite others, bool [B, H, W]
    fuel: Tensor  # the trees that can ignite, bool [B, H, W]

    @property
    def own(self) -> Tensor:
        """Return the flat index of each cell in its map, int32 [N]."""
        return self.row * self.spreads.shape[2] + self.column


def band_of(cell: Tensor, state: WorldState, spreads: Tensor, fuel: Tensor) -> Band:
    """Return the band of some cells, flat indices in [B, H, W], int64 [N]; see ``Band`` for the planes."""
    _, height, width = state.cells.shape
    world = cell.div(height * width, rounding_mode="floor")
    place = cell - world * (height * width)
    row = place.div(width, rounding_mode="floor")
    column = place - row * width
    around = places_around(cell, (height, width))
    return Band(cell, world * (height * width), row.to(torch.int32), column.to(torch.int32), around, spreads, fuel)


def padded(plane: Tensor, beyond: float) -> Tensor:
    """Return maps [B, H, W] with a margin of one cell, flat."""
    return pad(plane, (1, 1, 1, 1), value=beyond).flatten()


def of_world(values: Tensor, cell: Tensor, state: WorldState) -> Tensor:
    """Return values of worlds, [B, 1, 1], in some cells, flat indices in [B, H, W], int64 [N]; [N]."""
    return values.flatten().index_select(0, cell.div(state.cells[0].numel(), rounding_mode="floor"))


def _lit(after: WorldState, trees: Tensor, cell: Tensor) -> WorldState:
    """Return worlds in which trees have caught fire.

    Args:
        after: The worlds, which are used up.
        trees: Their cells before, uint8 [B, H, W].
        cell: Flat indices of the trees, int64 [N].
    """
    return after.replace(
        cells=index_put(after.cells, cell, FIRST_FIRE),
        age=index_put(after.age, cell, trees.flatten().index_select(0, cell)),
        stage_age=None if after.stage_age is None else index_put(after.stage_age, cell, 0),
    )
