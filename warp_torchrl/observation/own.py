"""What an agent knows of itself."""

import math

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.world.role import PAPER_ROLES
from warp_torchrl.world.state import Action, WorldState
from warp_torchrl.world.team import Team
from warp_torchrl.world.world import World

_NUMBERS = (
    *("row", "column", "time_left", "wind_east", "wind_north", "steps_to_tick", "tank", "has_tank", "may_refill"),
)
SELF = (
    *_NUMBERS,
    *(f"role_{role}" for role in PAPER_ROLES),
    *(f"last_{action.name.lower()}" for action in Action),
)
"""Entries of ``self`` in every team; role and last action are one-hot, the latter zeros before the first."""
IDENTITY = ("identity_cos_1", "identity_sin_1", "identity_cos_2", "identity_sin_2")
"""Entries of ``self`` that tell an agent from its team-mates, see ``identity``."""
SELF_SIZE, IDENTITY_SIZE = len(SELF), len(IDENTITY)
PLACE, TIME_LEFT, WIND, LAST_ACTION = slice(0, 2), 2, slice(3, 5), slice(len(_NUMBERS) + len(PAPER_ROLES), SELF_SIZE)
"""Where ``self`` tells of the agent's row and column, of the time left, of the wind, and of its last action."""
WIND_SCALE = 20.0
"""Wind that an observation shows as 1 [m/s]."""


def own_names(team: Team, identity: bool = False) -> tuple[str, ...]:
    """Return the names of the entries of ``self``: ``SELF``, the identity if it is shown, then what only this team has.

    Those are its roles and its actions beside the paper's.
    """
    roles = (f"role_{role}" for role in team.role_names[len(PAPER_ROLES) :])
    actions = (f"last_{action}" for action in team.further_actions)
    return (*SELF, *(IDENTITY if identity else ()), *roles, *actions)


def own_vector(state: WorldState, world: World, shows_identity: bool = False) -> Tensor:
    """Return what each agent knows of itself, float32 [B, A, F], see ``own_names``."""
    height, width = state.cells.shape[1:]
    vehicles = state.vehicles
    row, column = vehicles.position.to(torch.float32).unbind(-1)
    shape, team = row.shape, world.team
    roles = one_hot(team.table(row.device).index, len(team.role_names)).expand(*shape, -1)
    last = _last_action(vehicles.last_action, team)
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
    parts = [torch.stack(columns, dim=-1), roles[..., : len(PAPER_ROLES)], last[..., : len(Action)]]
    if shows_identity:
        parts.append(identity(shape[1], row.device).expand(*shape, -1))
    if team.role_names != PAPER_ROLES or team.further_actions:
        parts += [roles[..., len(PAPER_ROLES) :], last[..., len(Action) :]]
    return torch.cat(parts, dim=-1)


def begins(own: Tensor) -> Tensor:
    """Return whether the first step of an episode is to come, bool [...], from ``self`` [..., F]."""
    return own[..., TIME_LEFT] == 1.0


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


def _last_action(code: Tensor, team: Team) -> Tensor:
    """Return the last action, one-hot, int64 [B, A, 11 + the team's further ones]; zeros before the first."""
    further = len(team.further_actions)
    if further and not team.allow_stay:
        code = code + (code >= int(Action.STAY))  # the place of stay is kept
    return one_hot(code + 1, len(Action) + further + 1)[..., 1:]


def _own_wind(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, scaled, float32 [B, A, 2]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        own = wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    else:
        index = position[..., 0] * wind.shape[3] + position[..., 1]
        own = wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
    return (own / WIND_SCALE).clamp(-3.0, 3.0)
