"""The ways of agents: where each finds fire, its share of the front, and what is worth seeing, by what the team knows.

A way is three numbers of ``status``: its direction to the east and to the north, each the gap over the moves to the
place, in -1..1, and how near the place is, e^(-m / 8) with m moves, Chebyshev's distance. Of places that are as good,
the mean. All are 0 where there is no such place. A way says where to be; ``advice`` says what to do.

Where sight is limited, fires are those on the map that agents assume (``World.assumed``).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.entries import Part
from warp_torchrl.env.observation.features import Context, Function
from warp_torchrl.env.observation.status import number
from warp_torchrl.heuristics.base import can_be_put_out, moves_between, rows_and_columns
from warp_torchrl.heuristics.coordinated import Coordinated, fire_front
from warp_torchrl.heuristics.seeking import by_own_view, worth_a_search
from warp_torchrl.world.arrays.shortlist import first_cells
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.presence import on_scene
from warp_torchrl.world.team.team import Team

_NEAR = 8.0
"""Moves at which a place is e times less near [cells]."""


WAYS: list[str] = []
"""Names of the ways below, of which an observation chooses."""


def check_ways(names: Sequence[str]) -> None:
    """Check a choice of ways.

    Raises:
        ValueError: If one is unknown or named twice.
    """
    unknown = [name for name in names if name not in WAYS]
    if unknown or len(set(names)) < len(names):
        got = unknown[0] if unknown else list(names)
        raise ValueError(f"ways must be a list of different names of {', '.join(WAYS)}, got {got}")


def _way(name: str) -> Callable[[Function], Function]:
    """Return what adds the numbers of a way to ``status``, where an observation chooses it by its name."""
    WAYS.append(name)
    parts = Part("vector", (f"{name}_east", f"{name}_north")), Part("scalar", (f"{name}_near",))
    return number(parts, lambda world, choice: name in choice.ways)


@_way("fire")
def way_to_fire(now: Context) -> Tensor:
    """Return the way to the nearest fire that can be put out, float32 [B, A, 3]."""
    known = _known(now)
    cells, burns = _fires(now, known.assumed)
    moves = moves_between(known.place, *rows_and_columns(cells, known.assumed))
    return _told(moves.masked_fill(~burns[:, None], torch.inf), moves, cells, known)


@_way("share")
def way_to_share(now: Context) -> Tensor:
    """Return the way to the best cell of the fire front to which no team-mate is nearer, float32 [B, A, 3].

    The best has the least m - 6 r, with m moves to it and its fire risk r (``Forecast.fire_risk``), as ``Coordinated``
    has it. Of agents that are as near, the first has the cell. Agents with and without ``extinguish`` divide the front
    apart. A team-mate whose place an agent does not know has none of it.
    """
    known = _known(now)
    forecast = now.forecast if known.assumed is now.state else now.world.forecast(known.assumed)
    cells, burns = _fires(now, known.assumed)
    risk = forecast.fire_risk().flatten(1).gather(1, cells)
    moves = moves_between(known.place, *rows_and_columns(cells, known.assumed))
    own = fire_front(burns, risk)[:, None] & _is_nearest(moves, known, now.world.team)
    cost = moves - Coordinated.risk_weight * risk[:, None]
    return _told(cost.masked_fill(~own, torch.inf), moves, cells, known)


@_way("search")
def way_to_search(now: Context) -> Tensor:
    """Return the way to where seeing is worth most, apart from team-mates, float32 [B, A, 3]; 0 where agents see all.

    See ``seeking.worth_a_search``.
    """
    place = now.state.vehicles.position
    if not now.world.sensing.is_limited:
        return torch.zeros(*place.shape[:2], 3, device=place.device)
    down, right = (worth_a_search(now.state, now.world) - place).to(torch.float32).unbind(-1)
    return _numbers(right, -down, torch.maximum(right.abs(), down.abs()))


class _Known(NamedTuple):
    """What agents know: R maps, one of each team, or one of each agent, R = B or B * A."""

    assumed: WorldState
    place: Tensor  # where the agents are, int64 [R, A, 2]
    there: Tensor | None  # those whose place is known, bool [R, A]; None where all are
    views: int  # maps of a world


def _known(now: Context) -> _Known:
    state, world = now.state, now.world
    assumed, place = now.assumed if world.sensing.is_limited else state, state.vehicles.position
    if len(assumed.key) == len(place):
        return _Known(assumed, place, on_scene(state), 1)
    agents, (known, told) = place.shape[1], world.sensing.knows_where(state, world.team, world.hearing)
    self = torch.eye(agents, dtype=torch.bool, device=place.device)
    places = torch.where(self[..., None], place[:, None], told)
    return _Known(assumed, places.flatten(0, 1), (known | self).flatten(0, 1), agents)


def _fires(now: Context, assumed: WorldState) -> tuple[Tensor, Tensor]:
    """Return the fires that can be put out, flat indices int64 [R, K], and which are no padding, bool [R, K]."""
    if "fires" not in now.kept:
        fire = can_be_put_out(assumed, now.world)
        now.kept["fires"] = first_cells(fire, fire[0].numel())
    cells, burns = now.kept["fires"]
    return cells, burns


def _is_nearest(moves: Tensor, known: _Known, team: Team) -> Tensor:
    """Return the cells to which no other agent of its kind is nearer than each, bool [R, A, K]."""
    can = team.table(moves.device).can["extinguish"]
    order = moves * len(can) + torch.arange(len(can), device=moves.device)[:, None]
    if known.there is not None:
        order = order.masked_fill_(~known.there[..., None], torch.inf)
    if len({"extinguish" in ROLES[role].abilities for role in team.agent_roles}) == 1:
        return order == order.amin(dim=1, keepdim=True)
    least = [order.masked_fill((can != kind)[:, None], torch.inf).amin(dim=1) for kind in (False, True)]
    return order == torch.stack(least, dim=1)[:, can.long()]


def _told(cost: Tensor, moves: Tensor, cells: Tensor, known: _Known) -> Tensor:
    """Return the numbers of the ways to the cells of the least cost, float32 [B, A, 3].

    Args:
        cost: Of each cell to each agent, ``inf`` where it is no place to go, float32 [R, A, K].
        moves: To it, float32 [R, A, K].
        cells: Flat indices, int64 [R, K].
        known: What agents know.
    """
    least = cost.amin(-1, keepdim=True)
    best = ((cost == least) & (least < torch.inf)).to(torch.float32)
    count = best.sum(-1).clamp(min=1.0)
    row, column = ((best * each[:, None]).sum(-1) / count for each in rows_and_columns(cells, known.assumed))
    told = _numbers(column - known.place[..., 1], known.place[..., 0] - row, (best * moves).sum(-1) / count)
    return by_own_view(told * (least < torch.inf), known.views)


def _numbers(east: Tensor, north: Tensor, moves: Tensor) -> Tensor:
    """Return the numbers of ways of so many cells east and north, float32 [..., 3]."""
    far = moves.clamp(min=1.0)
    return torch.stack((east / far, north / far, torch.exp(moves / -_NEAR)), dim=-1)
