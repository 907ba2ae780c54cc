"""Fronts of law ``rate`` as they came to some cells of worlds: their rate, intensity and flame length."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import places_around
from warp_torchrl.world.arrays.listing import filled, flat_cells, in_all
from warp_torchrl.world.law.arrivals import arrivals_in, pace_on
from warp_torchrl.world.law.passing import head_behaviour, passing, steepness_from
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import WorldState


class Front(NamedTuple):
    """Fire as it came to some cells, float32 [B, n] each."""

    minutes: Tensor  # when, since ignition
    rate: Tensor  # [m/min]
    intensity: Tensor  # [kW/m]
    flame_length: Tensor  # [m]


def front_at(fire: RateFire, state: WorldState, cell: Tensor, is_there: Tensor) -> Front:
    """Return the front that came to some burning cells in the air of now; see ``passing``.

    Args:
        fire: The automaton.
        state: The worlds.
        cell: Flat indices in each map, int64 [B, n].
        is_there: Which of them are meant, bool [B, n]; the front of others has no meaning.
    """
    place = flat_cells(is_there)
    cells = in_all(cell, state.cells[0].numel()).flatten().index_select(0, place)
    found = _front_of(fire, state, pad(cells, (0, filled(len(cells)) - len(cells))))
    none = torch.zeros(cell.numel(), device=cell.device)
    return Front(*(none.index_copy(0, place, each[: len(cells)]).view_as(cell) for each in found))


def _front_of(fire: RateFire, state: WorldState, cell: Tensor) -> tuple[Tensor, ...]:
    """Return what ``Front`` holds, float32 [N] each, in some cells, flat indices in [B, H, W], int64 [N]."""
    minutes = arrivals_in(state).minutes
    place = places_around(cell, (minutes.shape[1], minutes.shape[2]))
    around = pad(minutes, (1, 1, 1, 1), value=NEVER).flatten().index_select(0, place.flatten()).view(8, -1)
    arrival, pace = (plane.flatten().index_select(0, cell) for plane in (minutes, pace_on(state.ground)))
    heads = head_behaviour(fire.spread_at(state.ground, state.air, cell).each(lambda of: of[0, 0]))
    return arrival, *passing(steepness_from(around, arrival), pace, heads, state.ground.cell_size)
