"""What an agent looks at: the square of the map about it, as it is or as it is known, of which channels are made."""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import at_least, byte, equal, scatter_add, to_int32
from warp_torchrl.world.arrays.squares import Window, window
from warp_torchrl.world.state.records import freshness, read, records_of
from warp_torchrl.world.state.state import Forecast, WorldState
from warp_torchrl.world.world import World

_CELLS, _BURNED, _FIREBREAK, _ON_MAP = 0x0F, 0x10, 0x20, 0x40
"""Bits of a cell that is read: its code, whether it burned, is a firebreak, and lies on the map."""


class Look(NamedTuple):
    """What a channel reads: the worlds, and the square of 2 r + 1 = V cells about each agent, north up.

    Where agents keep records of the fire (``world.state.records``), ``cells``, ``ash`` and ``firebreak``
    are what the agent knows, ``wet`` is of cells in sight, ``others`` are those that it hears or sees, and
    ``fire_risk`` is 0.
    """

    state: WorldState
    world: World
    forecast: Forecast
    window: Window  # ``window.of(plane)`` shows any plane [B, H, W] of numbers, 0 beyond the map
    on_map: Tensor  # 1 on the map, 0 beyond, [B, A, V, V], whole numbers, as all that follow
    cells: Tensor  # the world's codes
    ash: Tensor  # 1 where a tree has burned to ash and none stands
    firebreak: Tensor  # 1 where an agent has cleared
    wet: Tensor  # ticks for which the cell cannot ignite
    alpha: Tensor  # flammability, 255 times
    fire_risk: Tensor  # ``Forecast.fire_risk``, 255 times
    others: Tensor  # 63 for each other agent of each of ``Team.role_names``, four at most, [B, A, R, V, V]
    fresh: Tensor | None = None  # how fresh is what is known, ``records.freshness`` 255 times; None where all is seen


def look_at(state: WorldState, world: World, forecast: Forecast, radius: int) -> Look:
    """Return the squares about the agents.

    Codes, ash, firebreaks and the map are read at once, as the bits of a byte.
    """
    records = records_of(state)
    if records is not None:
        return _look_by_knowledge(state, records, world, forecast, radius)
    burned, cleared = to_int32(state.burned.view(torch.uint8)), to_int32(state.firebreak.view(torch.uint8))
    code = torch.add(to_int32(state.cells), burned, alpha=_BURNED).add_(cleared, alpha=_FIREBREAK).add_(_ON_MAP)
    risk = forecast.expected_ignitions, forecast.ignition_probability
    square = window(state.vehicles.position, state.cells.shape[1:], radius)
    code, wet, alpha, fire_risk = square.bytes_of([code, state.wet], [(state.alpha,), risk])
    return Look(
        state=state,
        world=world,
        forecast=forecast,
        window=square,
        on_map=byte(at_least(code, _ON_MAP)),
        cells=code & _CELLS,
        ash=byte(equal(code & (_CELLS | _BURNED), _BURNED)),
        firebreak=byte(equal(code & _FIREBREAK, _FIREBREAK)),
        wet=wet,
        alpha=alpha,
        fire_risk=fire_risk,
        others=_others(state, world, radius),
    )


def _look_by_knowledge(state: WorldState, knowledge: Tensor, world: World, forecast: Forecast, radius: int) -> Look:
    """Return the squares about the agents as each of them knows them."""
    square = window(state.vehicles.position, state.cells.shape[1:], radius)
    record = square.of_own(knowledge)
    fresh = freshness(record, state.step)
    cells, ash, cleared = read(record)
    return Look(
        state=state,
        world=world,
        forecast=forecast,
        window=square,
        on_map=square.inside,
        cells=cells,
        ash=byte(ash),
        firebreak=byte(cleared),
        wet=square.of(state.wet) * byte(fresh == 1.0),
        alpha=(square.of(state.alpha) * 255.0).to(torch.uint8),
        fire_risk=torch.zeros_like(square.inside),
        others=_others(state, world, radius),
        fresh=(fresh * 255.0).to(torch.uint8) * square.inside,
    )


def _others(state: WorldState, world: World, radius: int) -> Tensor:
    """Return where the other agents of each role are, 63 each, at most 4 to a cell, uint8 [B, A, R, V, V]."""
    position, role = state.vehicles.position, world.team.table(state.cells.device).index
    side, roles = 2 * radius + 1, len(world.team.role_names)
    known, place = world.sensing.knows_where(state, world.team, world.hearing)
    cell = place - position[:, :, None] + radius  # of each in each other's square
    is_near = (cell == cell.clamp(0, side - 1)).all(-1) & known
    row, column = cell.unbind(-1)
    index = torch.where(is_near, (role * side + row) * side + column, roles * side**2)
    count = torch.zeros(*row.shape[:2], roles * side**2 + 1, dtype=torch.uint8, device=role.device)
    count = scatter_add(count, index, torch.ones_like(index, dtype=torch.uint8))[..., :-1]
    return count.clamp(max=4).mul_(63).unflatten(-1, (roles, side, side))
