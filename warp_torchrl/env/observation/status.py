"""What an agent knows of itself."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.entries import ADVICE, LAST, TIME_LEFT, Part, Vector
from warp_torchrl.env.observation.advice import advised_actions
from warp_torchrl.env.observation.rules import RULES, rules
from warp_torchrl.env.observation.water import WATER, way_to_water
from warp_torchrl.world.state.role import PAPER_ROLES
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.team.flight import wind_at
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World

_ACTIONS = tuple(action.name.lower() for action in Action)
STATUS = Vector(
    (
        Part("place", ("row", "column")),
        Part("scalar", (TIME_LEFT,)),
        Part("vector", ("wind_east", "wind_north")),
        Part("scalar", ("steps_to_tick", "tank", "has_tank", "may_refill", *(f"role_{role}" for role in PAPER_ROLES))),
        Part("actions", tuple(f"{LAST}{name}" for name in _ACTIONS)),
    )
)
"""Entries of ``status`` in every team; role and last action are one-hot, the latter zeros before the first."""
STATUS_SIZE = len(STATUS.names)
"""How many they are."""
IDENTITY = Part("scalar", ("identity_cos_1", "identity_sin_1", "identity_cos_2", "identity_sin_2"))
"""Entries of ``status`` that tell an agent from its team-mates, see ``identity``."""
WIND_SCALE = 20.0
"""Wind that an observation shows as 1 [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Told:
    """What ``status`` tells beside what it tells every agent.

    Attributes:
        identity: The agent's place in its team, see ``identity``.
        rules: The rules of the world, see ``rules``.
        water: The way to water, see ``way_to_water``.
        advice: What a heuristic would have the agent do, see ``advised_actions``, by its name; None has none.
    """

    identity: bool = False
    rules: bool = False
    water: bool = False
    advice: str | None = None


def status_entries(world: World, told: Told = Told()) -> Vector:
    """Return the entries of ``status``, by name and as they turn with the map.

    They are ``STATUS``, the identity if it is told, then the team's roles and actions beside the paper's, then the
    battery if it runs down, then the agency that the vehicle serves, one-hot, if there are several, then the rules, the
    way to water and the advised action, one-hot, if they are told.
    """
    team = world.team
    roles = tuple(f"role_{role}" for role in team.role_names[len(PAPER_ROLES) :])
    actions = tuple(f"{LAST}{action}" for action in team.further_actions)
    battery = () if team.flight.battery is None else ("battery",)
    parts = [*STATUS.parts, *([IDENTITY] if told.identity else [])]
    parts += [Part("scalar", names) for names in (roles, actions, battery, world.agencies.names) if names]
    parts += [*([RULES] if told.rules else []), *(WATER if told.water else [])]
    if told.advice is not None:
        parts.append(Part("actions", tuple(f"{ADVICE}{name}" for name in (*_ACTIONS, *team.further_actions))))
    return Vector(tuple(parts))


def status_vector(state: WorldState, world: World, told: Told = Told()) -> Tensor:
    """Return what each agent knows of itself, float32 [B, A, F], see ``status_entries``."""
    height, width = state.cells.shape[1:]
    vehicles = state.vehicles
    row, column = vehicles.position.to(torch.float32).unbind(-1)
    shape, team = row.shape, world.team
    roles = one_hot(team.table(row.device).index, len(team.role_names)).expand(*shape, -1)
    last = _one_hot_action(vehicles.last_action, team)
    full = world.team.tank or 1
    wind = (wind_at(state) / WIND_SCALE).clamp(-3.0, 3.0)
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
    if told.identity:
        parts.append(identity(shape[1], row.device).expand(*shape, -1))
    if team.role_names != PAPER_ROLES or team.further_actions:
        parts += [roles[..., len(PAPER_ROLES) :], last[..., len(Action) :]]
    if team.flight.battery is not None and vehicles.battery is not None:
        parts.append((vehicles.battery / team.flight.battery)[..., None])
    if vehicles.serves is not None:
        parts.append(one_hot(vehicles.serves, len(world.agencies.names)))
    if told.rules:
        parts.append(rules(world, row.device).expand(*shape, -1))
    if told.water:
        parts.append(way_to_water(state, world))
    if told.advice is not None:
        parts.append(_one_hot_action(advised_actions(state, world, told.advice), team))
    return torch.cat(parts, dim=-1)


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


def _one_hot_action(code: Tensor, team: Team) -> Tensor:
    """Return actions int64 [B, A] one-hot, int64 [B, A, 11 + the team's further ones]; zeros for -1, which is none."""
    further = len(team.further_actions)
    if further and not team.allow_stay:
        code = code + (code >= int(Action.STAY))  # the place of stay is kept
    return one_hot(code + 1, len(Action) + further + 1)[..., 1:]
