"""The team shares the front of the fire out."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    Heuristic,
    can_be_put_out,
    claim_cells,
    extinguish_or,
    list_cells,
    move_towards,
    target_or_water,
)
from warp_torchrl.world.state import WorldState


class Coordinated(Heuristic):
    """Shares the front out: agents claim distinct cells of it by distance and threat, so that they spread round the
    fire and its head is attacked first; on the way, and there, they put out what they can reach.
    """

    risk_weight = 6.0  # cells of way that a full threat is worth

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        value, front = self.value(state)
        cells, valid = list_cells(front)
        worth = value.flatten(1).gather(1, cells).masked_fill_(~valid, -math.inf)
        claims = claim_cells(state, cells, worth[:, None], spacing=3, discount=6.0, taken=1000.0)
        return extinguish_or(move_towards(state, self.env, target_or_water(state, self.env, claims)), mask)

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return what each cell is worth [cells of way], float32 [B, H, W], and which are of the front, bool."""
        fire = can_be_put_out(state, self.env)
        threat = self.env.world.forecast(state).fire_risk()
        front = fire & (threat > 0.01)
        front = torch.where(front.flatten(1).any(1)[:, None, None], front, fire)
        return self.risk_weight * threat, front
