"""What an agent knows of itself."""

import math

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.symmetry import TIME_LEFT, Part, Vector
from warp_torchrl.world.role import ROLE_NAMES
from warp_torchrl.world.state import Action, WorldState
from warp_torchrl.world.world import World

SELF = Vector(
    (
        Part("place", ("row", "column")),
        Part("scalar", (TIME_LEFT,)),
        Part("vector", ("wind_east", "wind_north")),
        Part("scalar", ("steps_to_tick", "tank", "has_tank", "may_refill", *ROLE_NAMES)),
        Part("actions", tuple(action.name.lower() for action in Action)),
    )
)
"""Entries of ``self``: place, time left, wind, steps to the tick, tank, whether it has a tank, whether it may refill
here, role (one-hot), last action (one-hot, zeros before the first)."""
SELF_SIZE = len(SELF.names)
"""How many they are."""
IDENTITY = Part("scalar", ("cos_1", "sin_1", "cos_2", "sin_2"))
"""Entries of ``self`` that tell an agent from its team-mates, see ``identity``."""
WIND_SCALE = 20.0
"""Wind that an observation shows as 1 [m/s]."""


def own_vector(state: WorldState, world: World) -> Tensor:
    """Return what each agent knows of itself, float32 [B, A, F], see ``SELF_SIZE``."""
    height, width = state.cells.shape[1:]
    vehicles = state.vehicles
    row, column = vehicles.position.to(torch.float32).unbind(-1)
    shape = row.shape
    roles = one_hot(world.team.table(row.device).index, len(ROLE_NAMES)).expand(*shape, -1)
    last = one_hot(vehicles.last_action + 1, len(Action) + 1)[..., 1:]
    full = world.team.tank or 1
    wind = _own_wind(state)
    columns = [
        row / max(height - 1, 1),
        column / max(width - 1, 1),
        time_left(state, world)[:, None].expand(shape),
        wind[..., 0],
        wind[..., 1],
        steps_to_tick(state, world)[:, None].expand(shape),
        vehicles.tank.abs() / full,
        (vehicles.tank >= 0).to(torch.float32),
        (vehicles.position == vehicles.base[:, None]).all(-1).to(torch.float32),
    ]
    return torch.cat((torch.stack(columns, dim=-1), roles, last), dim=-1)


def identity(n_agents: int, device: torch.device) -> Tensor:
    """Return each agent's place in its team, float32 [A, 4].

    The place t = (i + 1/2) / A is told as cos 2 pi t, sin 2 pi t, cos 4 pi t, sin 4 pi t, whatever the team's size.
    """
    turn = 2.0 * math.pi * (torch.arange(n_agents, device=device) + 0.5) / n_agents
    return torch.stack((turn.cos(), turn.sin(), (2.0 * turn).cos(), (2.0 * turn).sin()), dim=-1)


def time_left(state: WorldState, world: World) -> Tensor:
    """Return the share of the episode that is left, float32 [B]."""
    return 1.0 - state.step / world.horizon


def steps_to_tick(state: WorldState, world: World) -> Tensor:
    """Return the share of the steps between two ticks that is left, float32 [B]."""
    return 1.0 - (state.step % world.steps_per_tick) / world.steps_per_tick


def _own_wind(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, scaled, float32 [B, A, 2]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        own = wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    else:
        index = position[..., 0] * wind.shape[3] + position[..., 1]
        own = wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
    return (own / WIND_SCALE).clamp(-3.0, 3.0)
