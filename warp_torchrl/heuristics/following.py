"""Baseline that watches: it follows the known fire front."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    distance_from,
    distance_to_cells,
    idle_action,
    move_towards,
    place,
    target_or_supply,
)
from warp_torchrl.heuristics.searching import Oldest
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.front import spreading_front
from warp_torchrl.world.state.records import known_codes, records_of, steps_since
from warp_torchrl.world.state.state import WorldState

_ANOTHERS = 1e6
"""What a cell is worth less to an agent that knows another to be nearer to it."""


class Follower(Oldest):
    """Goes to the known cell of the front that it saw longest ago, and leaves to others the cells nearer to them.

        score = steps since the cell was seen - steps to go there + draw

    If it knows no such cell it searches as ``Oldest`` does; if it cannot move at all it does nothing. It never
    extinguishes. It knows the other agents that it hears or sees.
    """

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        found, cell = self._oldest_of_front(state)
        target = torch.where(found[..., None], cell, self.search(state))
        move = move_towards(state, self.world, target_or_supply(state, self.world, target))
        return torch.where(mask.gather(-1, move[..., None])[..., 0], move, idle_action(mask, self.world.team))

    def _oldest_of_front(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return whether each agent has a target cell of the front, bool [B, A], and the cell, int64 [B, A, 2]."""
        agents, (height, width) = state.vehicles.position.shape[1], state.cells.shape[1:]
        device, team = state.cells.device, self.world.team
        records = records_of(state)
        codes = state.cells[:, None].expand(-1, agents, -1, -1) if records is None else known_codes(state)
        front = spreading_front(codes, state.alpha[:, None])
        since = 0 if records is None else steps_since(records, state.step)
        away = distance_to_cells(state)
        draw = uniform(state.key, 0, Stream.POLICY, (agents, height, width))
        score = since - away / team.table(device).stride[:, None, None] + draw
        known, place_of_others = self.world.sensing.knows_where(state, team, self.world.hearing)
        theirs = distance_from(place_of_others, state)
        nearest = torch.where(known[..., None, None], theirs, height + width).amin(dim=2)
        score = score - _ANOTHERS * (nearest < away)
        best = score.masked_fill(~front, -2.0 * _ANOTHERS).flatten(2).max(dim=-1)
        return best.values > -0.5 * _ANOTHERS, place(best.indices, state)
