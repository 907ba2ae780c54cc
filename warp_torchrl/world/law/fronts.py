"""Fronts of law ``rate`` as they came to some cells of worlds: their rate, intensity and flame length."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.law.arrivals import arrivals_in, pace_on
from warp_torchrl.world.law.automaton import at_cells
from warp_torchrl.world.law.passing import HeadBehaviour, head_behaviour, passing, steepness_from
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import WorldState


class Front(NamedTuple):
    """Fire as it came to some cells, float32 [B, n] each."""

    minutes: Tensor  # when, since ignition
    rate: Tensor  # [m/min]
    intensity: Tensor  # [kW/m]
    flame_length: Tensor  # [m]


def front_at(fire: RateFire, state: WorldState, cell: Tensor) -> Front:
    """Return the front that came to some burning cells, int64 [B, n], in the air of now; see ``passing``."""
    minutes, width = arrivals_in(state).minutes, state.cells.shape[2]
    row, column = cell.div(width, rounding_mode="floor"), cell % width
    padded = pad(minutes, (1, 1, 1, 1), value=NEVER).flatten(1)
    own = (row + 1) * (width + 2) + column + 1
    around = torch.stack([padded.gather(1, own + down * (width + 2) + right) for down, right in DIRECTIONS])
    arrival = at_cells(minutes, cell)
    then = head_behaviour(fire.head_at(state, cell))
    heads = HeadBehaviour(*(each[:, 0] for each in (then.head, then.backing, then.intensity, then.flame_length)))
    pace = at_cells(pace_on(state.ground), cell)
    rate, intensity, flame_length = passing(steepness_from(around, arrival), pace, heads, state.ground.cell_size)
    return Front(arrival, rate, intensity, flame_length)
