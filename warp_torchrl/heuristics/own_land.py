"""Baseline of agencies that each protect their own land."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    claim_cells,
    extinguish_or,
    idle_action,
    move_towards,
    target_or_supply,
)
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.state.state import WorldState


class OwnLand(Coordinated):
    """As ``Coordinated``, but a vehicle goes only to fire on the land of the agency that it serves. Where none burns it
    waits, and puts out what it can reach. Where there is but one agency it is ``Coordinated``.
    """

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        land = self.world.agencies.own_land(state)
        if land is None:
            return super().choose(state, mask)
        value, front = self.value(state)
        cells, valid = list_cells(front)
        own = land.flatten(2).gather(2, cells[:, None].expand(-1, mask.shape[1], -1)) & valid[:, None]
        worth = value.flatten(1).gather(1, cells)[:, None].expand(own.shape).masked_fill(~own, -math.inf)
        claims = claim_cells(state, cells, worth, spacing=3, discount=6.0, taken=1000.0)
        move = move_towards(state, self.world, target_or_supply(state, self.world, claims))
        waits = idle_action(mask, self.world.team)
        return extinguish_or(torch.where(own.any(dim=-1), move, waits), mask)
