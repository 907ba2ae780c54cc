"""The ways of agents: where each finds fire, its share of the front, and what is worth seeing, by what the team knows.

A way is three numbers of ``status``: its direction to the east and to the north, each the gap over the moves to the
place, in -1..1, and how near the place is, e^(-m / 8) with m moves, Chebyshev's distance. Of places that are as good,
the mean. All are 0 where there is no such place. A way says where to be; ``advice`` says what to do.

Where sight is limited, fires are those on the map that agents assume (``World.assumed``).
"""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.entries import Part
from warp_torchrl.env.observation.features import Context
from warp_torchrl.env.observation.status import number
from warp_torchrl.heuristics import Coordinated
from warp_torchrl.heuristics.base import can_be_put_out, distance_from
from warp_torchrl.heuristics.seeking import worth_a_search
from warp_torchrl.world.arrays.counting import counting
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.presence import on_scene
from warp_torchrl.world.world import World

_NEAR = 8.0
"""Moves at which a place is e times less near [cells]."""


def _way(name: str) -> tuple[Part, ...]:
    """Return the names of the numbers of a way."""
    return Part("vector", (f"{name}_east", f"{name}_north")), Part("scalar", (f"{name}_near",))


@number(_way("fire"))
def way_to_fire(now: Context) -> Tensor:
    """Return the way to the nearest fire that can be put out, float32 [B, A, 3]."""
    known = _known(now)
    fire = can_be_put_out(known.assumed, now.world)[:, None]
    distance = distance_from(known.place, known.assumed)
    return _told(distance.masked_fill(~fire, torch.inf), distance, known)


@number(_way("share"))
def way_to_share(now: Context) -> Tensor:
    """Return the way to the best cell of the fire front to which no team-mate is nearer, float32 [B, A, 3].

    The best has the least m - 6 r, with m moves to it and its fire risk r (``Forecast.fire_risk``), as ``Coordinated``
    has it. Of agents that are as near, the first has the cell. Agents with and without ``extinguish`` divide the front
    apart. A team-mate whose place an agent does not know has none of it.
    """
    known, can = _known(now), now.world.team.table(now.state.cells.device).can["extinguish"]
    value, front = Coordinated(_Worlds(now.world, known.assumed)).value(known.assumed)
    distance = distance_from(known.place, known.assumed)
    index = torch.arange(len(can), device=can.device)[:, None, None]
    order = (distance * len(can) + index).masked_fill(~known.there[..., None, None], torch.inf)
    of_kind = [order.masked_fill((can != kind)[:, None, None], torch.inf).amin(dim=1) for kind in (False, True)]
    own = front[:, None] & (order == torch.stack(of_kind, dim=1)[:, can.long()])
    return _told((distance - value[:, None]).masked_fill(~own, torch.inf), distance, known)


@number(_way("search"))
def way_to_search(now: Context) -> Tensor:
    """Return the way to where seeing is worth most, apart from team-mates, float32 [B, A, 3]; 0 where agents see all.

    See ``seeking.worth_a_search``.
    """
    place = now.state.vehicles.position
    if not now.world.sensing.is_limited:
        return torch.zeros(*place.shape[:2], 3, device=place.device)
    down, right = (worth_a_search(now.state, now.world) - place).to(torch.float32).unbind(-1)
    return _numbers(right, -down, torch.maximum(right.abs(), down.abs()))


class _Worlds(NamedTuple):
    """What a heuristic reads, without an environment."""

    world: World
    shared_state: WorldState


class _Known(NamedTuple):
    """What agents know: R maps, one of each team, or one of each agent, R = B or B * A."""

    assumed: WorldState
    place: Tensor  # where the agents are, int64 [R, A, 2]
    there: Tensor  # those whose place is known, bool [R, A]
    views: int  # maps of a world


def _known(now: Context) -> _Known:
    state, world = now.state, now.world
    assumed, place = now.assumed if world.sensing.is_limited else state, state.vehicles.position
    agents, present = place.shape[1], on_scene(state)
    if len(assumed.key) == len(place):
        there = torch.ones_like(place[..., 0], dtype=torch.bool) if present is None else present
        return _Known(assumed, place, there, 1)
    known, told = world.sensing.knows_where(state, world.team, world.hearing)
    self = torch.eye(agents, dtype=torch.bool, device=place.device)
    places = torch.where(self[..., None], place[:, None], told)
    return _Known(assumed, places.flatten(0, 1), (known | self).flatten(0, 1), agents)


def _told(cost: Tensor, distance: Tensor, known: _Known) -> Tensor:
    """Return the numbers of the ways to the cells of the least cost, float32 [B, A, 3].

    Args:
        cost: Of each cell to each agent, ``inf`` where it is no place to go, float32 [R, A, H, W].
        distance: Moves to it, float32 [R, A, H, W].
        known: What agents know.
    """
    least = cost.flatten(2).amin(-1)[..., None, None]
    best = ((cost == least) & (least < torch.inf)).to(torch.float32)
    count = best.sum((2, 3)).clamp(min=1.0)
    row, column = ((best.sum(3 - axis) * counting(best.shape[2 + axis], best)).sum(-1) / count for axis in (0, 1))
    steps = (best * distance).sum((2, 3)) / count
    told = _numbers(column - known.place[..., 1], known.place[..., 0] - row, steps)
    told = told * (least[..., 0] < torch.inf)
    if known.views == 1:
        return told
    return told.unflatten(0, (-1, known.views)).diagonal(dim1=1, dim2=2).mT


def _numbers(east: Tensor, north: Tensor, moves: Tensor) -> Tensor:
    """Return the numbers of ways of so many cells east and north, float32 [..., 3]."""
    far = moves.clamp(min=1.0)
    return torch.stack((east / far, north / far, torch.exp(moves / -_NEAR)), dim=-1)
