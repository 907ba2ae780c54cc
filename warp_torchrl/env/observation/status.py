"""What an agent knows of itself: a table of numbers by name.

A number reads a ``Context`` and is in -3..3. A module of a user's own adds one, which ``observation.features`` chooses:

    @number()
    def steepness(now: Context) -> Tensor:
        ...
"""

import math
from collections.abc import Callable, Sequence

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.entries import ADVICE, LAST, TIME_LEFT, Part
from warp_torchrl.env.observation.advice import advised_actions
from warp_torchrl.env.observation.features import (
    NOTHING_MORE,
    Choice,
    Context,
    Features,
    Function,
    IsThere,
    anything,
    everywhere,
)
from warp_torchrl.env.observation.rules import RULES, rules_of
from warp_torchrl.env.observation.water import WATER, way_to_water
from warp_torchrl.system.modes import kept
from warp_torchrl.world.state.role import PAPER_ROLES
from warp_torchrl.world.state.state import Action, Forecast, WorldState
from warp_torchrl.world.team.places import wind_at
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World

WIND_SCALE = 20.0
"""Wind that an observation shows as 1 [m/s]."""
_ACTIONS = tuple(action.name.lower() for action in Action)
STATUS = Features("number of status")
"""All numbers of ``status``, by name and in order."""


def number(
    parts: Callable[[World], Sequence[Part]] | Sequence[Part] = (), is_there: IsThere | None = None
) -> Callable[[Function], Function]:
    """Return what adds a function to the table, under the function's name.

    The function returns numbers in -3..3, float32 [B, A], or [B, A, n] of several.

    Args:
        parts: What the numbers are called, and how they turn with the map; a function of the world where it says. By
            default one that does not turn, and has the function's name.
        is_there: Returns whether a world shows it; None where an observation chooses it by name.

    Raises:
        ValueError: If the table has another number of that name.
    """

    def added(show: Function) -> Function:
        return STATUS.add(parts or [Part("scalar", (show.__name__,))], anything, 1, is_there)(show)

    return added


def status_vector(state: WorldState, world: World, forecast: Forecast, choice: Choice = NOTHING_MORE) -> Tensor:
    """Return what each agent knows of itself, float32 [B, A, F], the numbers of ``STATUS`` that are there."""
    now = Context(state, world, forecast, choice)
    shown = [each.show(now) for each in STATUS.shown(world, choice)]
    return torch.cat([each if each.ndim == 3 else each[..., None] for each in shown], dim=-1)


@number([Part("place", ("row", "column"))], everywhere)
def place(now: Context) -> Tensor:
    """Return where the agent is, as shares of the map."""
    height, width = now.state.cells.shape[1:]
    row, column = now.state.vehicles.position.to(torch.float32).unbind(-1)
    return torch.stack((row / max(height - 1, 1), column / max(width - 1, 1)), dim=-1)


@number([Part("scalar", (TIME_LEFT,))], everywhere)
def clock(now: Context) -> Tensor:
    """Return the share of the episode that is left."""
    return _of_each(time_left(now.state, now.world), now)


@number([Part("vector", ("wind_east", "wind_north"))], everywhere)
def wind(now: Context) -> Tensor:
    """Return the wind at the agent's cell, over 20 m/s, at most 3."""
    return (wind_at(now.state) / WIND_SCALE).clamp(-3.0, 3.0)


@number([Part("scalar", ("steps_to_tick",))], everywhere)
def next_tick(now: Context) -> Tensor:
    """Return the share of the steps between two ticks that is left."""
    return _of_each(steps_to_tick(now.state, now.world), now)


@number(is_there=everywhere)
def tank(now: Context) -> Tensor:
    """Return the share of the tank that is full; 1 of a team without tanks."""
    return now.state.vehicles.tank.abs() / (now.world.team.tank or 1)


@number(is_there=everywhere)
def has_tank(now: Context) -> Tensor:
    """Return 1 in a team with tanks."""
    return (now.state.vehicles.tank >= 0).to(torch.float32)


@number(is_there=everywhere)
def may_refill(now: Context) -> Tensor:
    """Return 1 where the team started."""
    vehicles = now.state.vehicles
    return (vehicles.position == vehicles.base[:, None]).all(-1).to(torch.float32)


@number([Part("scalar", tuple(f"role_{role}" for role in PAPER_ROLES))], everywhere)
def role(now: Context) -> Tensor:
    """Return the agent's role, one-hot: the paper's roles."""
    return _one_hot_role(now)[..., : len(PAPER_ROLES)]


@number([Part("actions", tuple(f"{LAST}{name}" for name in _ACTIONS))], everywhere)
def last_action(now: Context) -> Tensor:
    """Return the agent's last action, one-hot, zeros before the first: the paper's actions and stay."""
    return _one_hot_action(now.state.vehicles.last_action, now.world.team)[..., : len(Action)]


@number(
    [Part("scalar", ("identity_cos_1", "identity_sin_1", "identity_cos_2", "identity_sin_2"))],
    lambda world, choice: choice.identity,
)
def identity(now: Context) -> Tensor:
    """Return each agent's place in its team.

    The place t = (i + 1/2) / A is told as cos 2 pi t, sin 2 pi t, cos 4 pi t, sin 4 pi t, whatever the team's size.
    """
    position = now.state.vehicles.position
    return _places_in_team(position.shape[1], position.device).expand(len(position), -1, -1)


@kept(64)
def _places_in_team(agents: int, device: torch.device) -> Tensor:
    """Return the numbers of ``identity``, float32 [A, 4]."""
    turn = 2.0 * math.pi * (torch.arange(agents, device=device) + 0.5) / agents
    return torch.stack((turn.cos(), turn.sin(), (2.0 * turn).cos(), (2.0 * turn).sin()), dim=-1)


@number(
    lambda world: [Part("scalar", tuple(f"role_{role}" for role in world.team.role_names[len(PAPER_ROLES) :]))],
    lambda world, choice: len(world.team.role_names) > len(PAPER_ROLES),
)
def further_role(now: Context) -> Tensor:
    """Return the agent's role, one-hot: the team's roles beside the paper's."""
    return _one_hot_role(now)[..., len(PAPER_ROLES) :]


@number(
    lambda world: [Part("scalar", tuple(f"{LAST}{action}" for action in world.team.further_actions))],
    lambda world, choice: bool(world.team.further_actions),
)
def further_last_action(now: Context) -> Tensor:
    """Return the agent's last action, one-hot: the team's actions beside the paper's."""
    return _one_hot_action(now.state.vehicles.last_action, now.world.team)[..., len(Action) :]


@number(
    lambda world: [Part("scalar", tuple(name for each in world.loop for name in each.entries(world)))],
    lambda world, choice: any(each.entries(world) for each in world.loop),
)
def mechanics(now: Context) -> Tensor:
    """Return the numbers of the world's mechanics, see ``Mechanic.status``."""
    return torch.cat([each.status(now.state) for each in now.world.loop if each.entries(now.world)], dim=-1)


@number([RULES], lambda world, choice: choice.rules)
def rules(now: Context) -> Tensor:
    """Return the rules of the world, see ``rules_of``."""
    position = now.state.vehicles.position
    return rules_of(now.world, position.device).expand(len(position), -1, -1)


@number(WATER, lambda world, choice: choice.water)
def water(now: Context) -> Tensor:
    """Return the way to water, see ``way_to_water``."""
    return way_to_water(now.state, now.world)


@number(
    lambda world: [Part("actions", tuple(f"{ADVICE}{name}" for name in (*_ACTIONS, *world.team.further_actions)))],
    lambda world, choice: bool(choice.advice),
)
def advice(now: Context) -> Tensor:
    """Return the action that a heuristic would choose for the agent, one-hot, see ``advised_actions``."""
    return _one_hot_action(advised_actions(now.state, now.world, now.choice.advice), now.world.team)


def time_left(state: WorldState, world: World) -> Tensor:
    """Return the share of the episode that is left, float32 [B]."""
    return 1.0 - state.step / world.horizon


def steps_to_tick(state: WorldState, world: World) -> Tensor:
    """Return the share of the steps between two ticks that is left, float32 [B]."""
    return 1.0 - (state.step % world.steps_per_tick) / world.steps_per_tick


def _of_each(number: Tensor, now: Context) -> Tensor:
    """Return a number of each world [B] for each of its agents [B, A]."""
    return number[:, None].expand(now.state.vehicles.tank.shape)


def _one_hot_role(now: Context) -> Tensor:
    """Return the agents' roles one-hot, int64 [B, A, roles]."""
    known = now.world.team.table(now.state.cells.device).one_hot
    return known.expand(len(now.state.step), -1, -1)


def _one_hot_action(code: Tensor, team: Team) -> Tensor:
    """Return actions int64 [B, A] one-hot, int64 [B, A, 11 + the team's further ones]; zeros for -1, which is none."""
    further = len(team.further_actions)
    if further and not team.allow_stay:
        code = code + (code >= int(Action.STAY))  # the place of stay is kept
    return one_hot(code + 1, len(Action) + further + 1)[..., 1:]
