"""Fire and wind without vehicles: how they begin, and one tick of them."""

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.backends import backend
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.state.state import Air, Landscape, Vehicles, WorldState


def initial_state(
    ground: Landscape,
    fire: Automaton,
    wind: Tensor,
    key: Tensor,
    vehicles: Vehicles,
    cell_size: float,
    moisture: Tensor | None = None,
) -> WorldState:
    """Return worlds at step 0 in which nothing burns yet.

    Args:
        ground: The landscapes, batch size [B].
        fire: The automaton, for flammability and slope factors.
        wind: float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s].
        key: World keys, int64 [B].
        vehicles: The team.
        cell_size: Side of a cell [m].
        moisture: Of ``Wind.moisture``.
    """
    cells = ground.age
    none = torch.zeros_like(cells)
    no = torch.zeros_like(cells, dtype=torch.bool)
    zero = torch.zeros_like(key, dtype=torch.int32)
    made = fire.ground(ground, cell_size, key)
    return WorldState(
        ground=made,
        air=backend.air(fire, wind, moisture, made),
        cells=cells.clone(),
        age=none,
        stage_age=none.clone() if fire.ticks_per_stage > 1 else None,
        initial=cells > 0,
        extinguished=no,
        burned=no.clone(),
        firebreak=no.clone(),
        wet=none.clone(),
        vehicles=vehicles,
        key=key,
        step=zero.clone(),
        tick=zero.clone(),
        burning_area=torch.zeros_like(zero, dtype=torch.float32),
        terminated=zero > 0,
        truncated=zero > 0,
    )


def advance(state: WorldState, fire: Automaton, wind: Wind, ticks_now: Tensor, air: Air | None = None) -> WorldState:
    """Advance fire and wind by one tick.

    Args:
        state: The worlds.
        fire: The automaton.
        wind: The air.
        ticks_now: Worlds that tick now, bool [B].
        air: After the tick, of imagined worlds; None: that of the worlds.
    """
    after = backend.fastest(fire, state.cells.device).tick(state, ticks_now)
    if not wind.changes:
        return after
    if air is not None:
        return in_wind(after, fire, air.wind, air.moisture)
    now = torch.where(ticks_now[:, None, None, None], wind.after_tick(after), state.wind)
    return in_wind(after, fire, now, wind.moisture(after.episode_key, after.tick))


def in_wind(state: WorldState, fire: Automaton, wind: Tensor, moisture: Tensor | None = None) -> WorldState:
    """Return worlds in another wind, float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s], and moisture; None keeps theirs."""
    return backend.in_wind(fire, state, wind, state.air.moisture if moisture is None else moisture)
