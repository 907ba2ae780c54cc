"""Baselines that search: they act on their agents' knowledge, as learned policies do.

Where sight is not limited (``sensing=full``) they know all, and go straight to the fire.
"""

from abc import abstractmethod

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    distance_to_cells,
    extinguish_or,
    known_fire,
    move_towards,
    nearest_marked,
    place,
    target_or_supply,
)
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.records import freshness, records_of
from warp_torchrl.world.state.state import WorldState


class Searching(Heuristic):
    """Extinguishes where it can, else goes to the nearest fire that it knows of, else searches.

    Agents whose role cannot extinguish always search.
    """

    reads_map = False

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        team = self.world.team
        fire = known_fire(state, self.world) & team.table(mask.device).can["extinguish"][:, None, None]
        found, index = nearest_marked(state, fire)
        target = torch.where(found[..., None], place(index, state), self.search(state))
        return extinguish_or(move_towards(state, self.world, target_or_supply(state, self.world, target)), mask)

    @abstractmethod
    def search(self, state: WorldState) -> Tensor:
        """Return the cell to which each agent goes while it knows of no fire, int64 [B, A, 2]."""


class Oldest(Searching):
    """Searches the cells that it has not seen for longest: greedy in staleness, distance, and the agent's sector.

        score = (1 - freshness) - 2 distance / max(H, W) - |sector of the cell - own sector| + draw / 10

    Sectors are shares of the right angle at the corner where the team started; the draw is one for each agent and cell.
    """

    def search(self, state: WorldState) -> Tensor:
        """Return the cell with the best score for each agent, int64 [B, A, 2]."""
        (height, width), agents = state.cells.shape[1:], state.vehicles.position.shape[1]
        row = torch.arange(height, device=state.cells.device)[:, None]
        column = torch.arange(width, device=state.cells.device)
        distance = distance_to_cells(state)
        away_row = (row - state.vehicles.base[:, 0, None, None]).abs()
        away_column = (column - state.vehicles.base[:, 1, None, None]).abs()
        sector = torch.atan2(away_row.float(), away_column.float()) / (torch.pi / 2.0)
        mine = (torch.arange(agents, device=row.device) + 0.5)[:, None, None] / agents
        records = records_of(state)
        stale = torch.zeros_like(distance) if records is None else 1.0 - freshness(records, state.step)
        draw = uniform(state.key, 0, Stream.POLICY, (agents, height, width))
        score = stale - 2.0 * distance / max(height, width) - (sector[:, None] - mine).abs() + 0.1 * draw
        return place(score.flatten(2).argmax(dim=-1), state)


class Lawnmower(Searching):
    """Searches in lanes: each agent sweeps a strip of the map, back and forth, with its sight as the lanes' width."""

    def search(self, state: WorldState) -> Tensor:
        """Return the point of its lanes where each agent should be by now, int64 [B, A, 2]."""
        (height, width), agents = state.cells.shape[1:], state.vehicles.position.shape[1]
        device, team = state.cells.device, self.world.team
        sees = torch.tensor(self.world.sensing.reach(team), device=device)
        edge = torch.arange(agents + 1, device=device) * width // agents
        first, last = edge[:-1], edge[1:] - 1
        lane = (2 * sees + 1).clamp(max=height)
        lanes = (height + lane - 1) // lane
        strip = (last - first + 1).clamp(min=1)
        length = strip + lane  # along one lane, and over to the next
        gone = state.step[:, None] * team.table(device).stride
        turn, along = gone // length % (2 * lanes), gone % length
        down = torch.where(turn < lanes, turn, 2 * lanes - 1 - turn)  # to the last lane and back again
        across = torch.where(turn % 2 == 0, first + along.clamp(max=strip - 1), last - along.clamp(max=strip - 1))
        row = (down * lane + sees).clamp(max=height - 1)
        row = torch.where(state.vehicles.base[:, :1] > 0, height - 1 - row, row)
        return torch.stack((row, across), dim=-1)
