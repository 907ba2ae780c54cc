"""Fronts of law ``rate`` as they came to some cells of worlds: their rate, intensity and flame length."""

from typing import NamedTuple

from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import places_around
from warp_torchrl.world.law.arrivals import arrivals_in, pace_on
from warp_torchrl.world.law.passing import head_behaviour, passing, steepness_from
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import WorldState


class Front(NamedTuple):
    """Fire as it came to some cells, float32 of one shape."""

    minutes: Tensor  # when, since ignition
    rate: Tensor  # [m/min]
    intensity: Tensor  # [kW/m]
    flame_length: Tensor  # [m]


def front_at(fire: RateFire, state: WorldState, cell: Tensor) -> Front:
    """Return the front that came to some burning cells in the air of now; see ``passing``.

    Args:
        fire: The automaton.
        state: The worlds.
        cell: Flat indices in [B, H, W], int64 [N]; N fills vectors, see ``arrays.listing``.
    """
    minutes = arrivals_in(state).minutes
    place = places_around(cell, (minutes.shape[1], minutes.shape[2]))
    around = pad(minutes, (1, 1, 1, 1), value=NEVER).flatten().index_select(0, place.flatten()).view(8, -1)
    arrival, pace = (plane.flatten().index_select(0, cell) for plane in (minutes, pace_on(state.ground)))
    heads = head_behaviour(fire.spread_at(state.ground, state.air, cell).each(lambda of: of[0, 0]))
    rate, intensity, flame_length = passing(steepness_from(around, arrival), pace, heads, state.ground.cell_size)
    return Front(arrival, rate, intensity, flame_length)
