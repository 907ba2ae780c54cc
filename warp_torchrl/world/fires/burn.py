"""Fire without vehicles: worlds that burn from given cells, and statistics of their fires."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.tick import advance, in_wind, initial_state
from warp_torchrl.world.law.arrivals import RATE, Arrivals
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.team.team import Team


@dataclass(eq=False, repr=False)
class FireHistory(Batch):
    """A fire from its first to its last tick, in each world; batch size [B]."""

    cells: Tensor  # uint8 [B,H,W], the codes after the last tick
    stage_age: Tensor | None  # uint8 [B,H,W], ticks burned in the present stage; None where a stage lasts one tick
    arrival: Tensor  # int32 [B,H,W], ticks until the cell first burned: 0 from the start, -1 never
    alight: Tensor  # int32 [B,T+1], cells that burn after each tick; the first is the start
    cell_size: float  # side of a cell [m]
    arrival_minutes: Tensor | None = None  # float32 [B,H,W] under law ``rate``: when the fire came, NaN never

    def burn_probability(self) -> Tensor:
        """Return the share of the worlds in which each cell burned, float32 [H, W]."""
        return (self.arrival >= 0).to(torch.float32).mean(dim=0)

    def mean_arrival(self) -> Tensor:
        """Return the mean ticks until each cell burned, over the worlds where it did, float32 [H, W]; else NaN."""
        return torch.where(self.arrival >= 0, self.arrival, torch.nan).nanmean(dim=0)

    def burned_area(self) -> Tensor:
        """Return the area that has caught fire by each tick, in hectares, float32 [B, T + 1]."""
        ticks = self.alight.shape[1]
        first = torch.zeros(len(self.arrival), ticks + 1, dtype=torch.int64, device=self.arrival.device)
        slot = torch.where(self.arrival >= 0, self.arrival, ticks).flatten(1).to(torch.int64)
        first.scatter_add_(1, slot, torch.ones_like(slot))
        return first[:, :ticks].cumsum(dim=1) * (self.cell_size**2 / 10_000.0)


def start_burning(
    ground: Landscape,
    *,
    wind: Wind,
    fire: Automaton,
    first_tick: int,
    stage_age: Tensor | None,
    seed: int,
    cell_size: float,
) -> WorldState:
    """Return worlds without vehicles that are ready for their tick number ``first_tick`` + 1.

    The ages of the ground are the codes of the cells; the other arguments are those of ``warp_torchrl.simulate``.
    """
    cells = ground.age
    seeds = seed + torch.arange(cells.shape[0], device=cells.device)
    key = world_key(seeds, torch.zeros_like(seeds))
    nobody = Team(n_agents=1).place(key, ground.cover, is_burning(cells))
    land = wind.shaped(ground, cell_size)
    air, moisture = wind.on(key, land), wind.moisture(key, torch.zeros_like(key))
    state = initial_state(land, fire, air, key, nobody, cell_size, moisture)
    state = fire.started(state)
    if state.stage_age is not None and stage_age is not None:
        state = state.replace(stage_age=stage_age)
    for tick in range(1, first_tick + 1 if wind.changes else 1):
        state = state.replace(tick=torch.full_like(state.tick, tick))
        state = in_wind(state, fire, wind.after_tick(state), wind.moisture(state.key, state.tick))
    return state.replace(tick=torch.full_like(state.tick, first_tick))


def burn(state: WorldState, fire: Automaton, wind: Wind, ticks: int) -> WorldState:
    """Return the worlds after ``ticks`` ticks."""
    everywhere = torch.ones_like(state.terminated)
    for _ in range(ticks):
        state = advance(state, fire, wind, everywhere)
    return state


def trace(state: WorldState, fire: Automaton, wind: Wind, ticks: int, cell_size: float) -> FireHistory:
    """Burn for ``ticks`` ticks and record when each cell caught fire."""
    burning = is_burning(state.cells)
    arrival = torch.where(burning, 0, -1).to(torch.int32)
    minutes = torch.where(burning, 0.0, torch.nan) if state.keeps(RATE) else None
    alight = [burning.sum((1, 2), dtype=torch.int32)]
    for tick in range(1, ticks + 1):
        state = burn(state, fire, wind, 1)
        burning = is_burning(state.cells)
        lit = burning & (arrival < 0)
        arrival.masked_fill_(lit, tick)
        if minutes is not None:
            minutes = torch.where(lit, state.planes(RATE, Arrivals).minutes, minutes)
        alight.append(burning.sum((1, 2), dtype=torch.int32))
    return FireHistory(
        cells=state.cells,
        stage_age=state.stage_age,
        arrival=arrival,
        alight=torch.stack(alight, dim=1),
        cell_size=cell_size,
        arrival_minutes=minutes,
    )
