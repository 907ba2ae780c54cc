"""Places of vehicles: their blocks of the map, the wind there, distances from the map's middle and each other."""

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.team.abilities import own_cell
from warp_torchrl.world.team.presence import pairs_there

_APPROACH = (0, 2, 4, 6, 7, 1, 3, 5)
"""Directions in the order in which an aircraft on its way to the fire prefers them: N, E, S, W, NW, NE, SE, SW."""


def wind_at(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, float32 [B, A, 2], (u east, v north) [m/s]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        return wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    index = position[..., 0] * wind.shape[3] + position[..., 1]
    return wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)


def block_of(state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map each agent is, int64 [B, A]."""
    return block_at(state.vehicles.position, state, side)


def block_at(place: Tensor, state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map cells are, int64 [...], of (row, column) int64 [..., 2]."""
    row, column = (place * side // _size(*state.cells.shape[1:], place.device)).unbind(-1)
    return torch.add(column, row, alpha=side)


@kept(32)
def _size(height: int, width: int, device: torch.device) -> Tensor:
    return torch.tensor([height, width], device=device)


def has_reached(state: WorldState) -> Tensor:
    """Return which agents have been over a tree that burned, or had, since they set out, bool [B, A].

    In teams that do not keep it, those that are now, or have acted in this episode.
    """
    cell, vehicles = own_cell(state), state.vehicles
    here = state.cells.flatten(1).gather(1, cell)
    burnt = (state.burned.flatten(1).gather(1, cell) != 0) & (here == 0)
    was = state.plane("retardant", "arrived")
    return is_burning(here) | burnt | (vehicles.acts > 0 if was is None else was)


def from_middle(state: WorldState) -> Tensor:
    """Return where each agent is from the middle of the map, (east, north), float32 [B, A, 2] [cells]."""
    height, width = state.cells.shape[1:]
    row, column = state.vehicles.position.to(torch.float32).unbind(-1)
    return torch.stack((column - 0.5 * (width - 1), 0.5 * (height - 1) - row), dim=-1)


def approach_move(state: WorldState) -> Tensor:
    """Return the move of each agent that has not reached the fire, int64 [B, A]; stay in the very middle of a map.

    It is the move to the cell with the least way to the middle, along rows and columns; of such that take as much, the
    first of N, E, S, W, NW, NE, SE, SW, and each place in that order is worth a tenth of a cell.
    """
    way = from_middle(state)
    order, preferred = _in_order(way.device)
    then = (way[..., None, :] + order).abs().sum(-1) - preferred
    move = then.argmin(dim=-1)
    return torch.where(way.abs().amax(dim=-1) < 0.5, int(Action.STAY), move)


def nearest_mate(state: WorldState) -> Tensor:
    """Return the index of the team-mate nearest to each agent, the first of those as near, int64 [B, A].

    Of an agent that is alone on the scene it is its own.
    """
    position = state.vehicles.position
    square = (position[:, :, None] - position[:, None]).square().sum(-1)
    alone = torch.eye(position.shape[1], dtype=torch.bool, device=position.device)
    square = square.masked_fill(~pairs_there(state, ~alone[None]), (1 << 40) + 1)
    return square.masked_fill(alone, 1 << 40).argmin(dim=-1)


def in_reach(state: WorldState, reach: list[int]) -> Tensor:
    """Return which cells are within each agent's reach by Chebyshev distance, bool [B, A, H, W].

    Args:
        state: The worlds.
        reach: Of each agent [cells].
    """
    height, width = state.cells.shape[1:]
    row, column = state.vehicles.position.unbind(-1)
    far = torch.tensor(reach, device=row.device)[:, None]
    on_row = (torch.arange(height, device=row.device) - row[..., None]).abs() <= far
    on_column = (torch.arange(width, device=row.device) - column[..., None]).abs() <= far
    return on_row[..., :, None] & on_column[..., None, :]


@kept(8)
def _in_order(device: torch.device) -> tuple[Tensor, Tensor]:
    """Return the (east, north) offset of each direction, float32 [8, 2], and what its place is worth, float32 [8]."""
    offsets = torch.tensor([(column, -row) for row, column in DIRECTIONS], dtype=torch.float32, device=device)
    worth = torch.tensor([0.1 * (8 - _APPROACH.index(each)) for each in range(8)], device=device)
    return offsets, worth
