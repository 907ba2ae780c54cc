"""Baseline in which agents divide the fire front among themselves."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    can_be_put_out,
    claim_cells,
    extinguish_or,
    move_towards,
    target_or_supply,
)
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.state.state import WorldState

LAST = 4096.0
"""By how much less cells are worth to agents that cannot extinguish: they choose after the others."""


class Coordinated(Heuristic):
    """Assigns distinct cells of the fire front to the agents by distance and fire risk, so that they spread around the
    fire and attack its head first. Agents extinguish whatever they can reach; those that cannot choose last.
    """

    risk_weight = 6.0  # value of fire risk 1 [cells of distance]

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        value, front = self.value(state)
        cells, valid = list_cells(front)
        worth = value.flatten(1).gather(1, cells).masked_fill_(~valid, -math.inf)
        can = self.world.team.table(mask.device).can["extinguish"]
        worth = worth[:, None] - LAST * (can.any() & ~can)[:, None]
        claims = claim_cells(state, cells, worth, spacing=3, discount=6.0, taken=1000.0)
        return extinguish_or(move_towards(state, self.world, target_or_supply(state, self.world, claims)), mask)

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return each cell's value [cells of distance], float32 [B, H, W], and the fire front, bool [B, H, W]."""
        threat = self.world.forecast(state).fire_risk()
        return self.risk_weight * threat, fire_front(can_be_put_out(state, self.world), threat)


def fire_front(fire: Tensor, risk: Tensor) -> Tensor:
    """Return the fires from which fire is about to grow; all of them in worlds where there are none.

    Args:
        fire: The cells whose fires count, bool [B, ...].
        risk: Their ``Forecast.fire_risk``, float32 [B, ...].
    """
    front = fire & (risk > 0.01)
    return torch.where(front.flatten(1).any(1).view(-1, *[1] * (fire.ndim - 1)), front, fire)
