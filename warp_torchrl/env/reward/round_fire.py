"""Reward of Haksar and Schwager for flying along the fire's edge."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.env.reward.base import Reward
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import Transition, WorldState
from warp_torchrl.world.team.places import from_middle, nearest_mate


@dataclass(frozen=True, kw_only=True)
class RoundFire(Reward):
    """Individual reward of each aircraft for its place at the fire's edge.

    Source: Haksar and Schwager, IROS 2018, with the numbers of the authors' public code. All terms read the forest
    before the step, and the cell that the aircraft enters. Neighbours beyond the map count as healthy. A move counts as
    one cell.

    Attributes:
        edge: For a burning tree with a healthy one among its four neighbours.
        interior: For another burning tree.
        beside: For a healthy tree with a burning or burnt one among its eight neighbours.
        far: For another healthy tree.
        crowded: For a move to within a cell of the team-mate that was nearest, if that has a lower number.
        parted: For a move away from within a cell of that team-mate.
        turn: For a move that is not counter-clockwise round the middle of the map.
    """

    team_share: float = 0.0
    shaping: float = 0.0
    edge: float = 1.0
    interior: float = -2.0
    beside: float = 0.5
    far: float = -1.0
    crowded: float = -10.0
    parted: float = 1.0
    turn: float = 1.0

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        before = transition.before
        moved = transition.result.moved[..., None]
        step = offsets(moved.device)[transition.result.action.clamp(0, 7)] * moved
        comes = before.vehicles.position + step
        return self._place(before, comes) + self._company(before, comes) + self._turn(before, step)

    def _place(self, before: WorldState, comes: Tensor) -> Tensor:
        """Return the worth of a cell (row, column), int64 [B, A, 2], float32 [B, A]."""
        burns, stands = is_burning(before.cells), is_tree(before.cells)
        codes = burns.to(torch.uint8) + (~burns & ~stands).to(torch.uint8) * 2
        seen = window(comes, before.cells.shape[1:], 1).of(codes).flatten(2)
        here, is_edge = seen[..., 4], (seen[..., 1::2] == 0).any(dim=-1)
        is_beside = (seen != 0).any(dim=-1)
        burning = torch.where(is_edge, self.edge, self.interior)
        healthy = torch.where(is_beside, self.beside, self.far)
        return burning * (here == 1) + healthy * (here == 0)

    def _company(self, before: WorldState, comes: Tensor) -> Tensor:
        """Return the worth of the direction to the nearest team-mate, float32 [B, A]."""
        position, mate = before.vehicles.position, nearest_mate(before)
        theirs = position.gather(1, mate[..., None].expand(-1, -1, 2))
        was, now = ((each - theirs).square().sum(-1) <= 1 for each in (position, comes))
        is_later = torch.arange(mate.shape[1], device=mate.device) > mate
        return (self.crowded * now + self.parted * (was & ~now)) * is_later

    def _turn(self, before: WorldState, step: Tensor) -> Tensor:
        """Return the worth of the direction of a step (rows, columns), int64 [B, A, 2], float32 [B, A]."""
        east, north = from_middle(before).unbind(-1)
        return self.turn * (east * -step[..., 0] - north * step[..., 1] <= 0.0)
