"""The reward of Haksar and Schwager."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.env.reward.base import Reward
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.mechanics.retardant.retardant import from_middle, nearest_mate
from warp_torchrl.world.state.state import Transition, WorldState, is_burning, is_tree


@dataclass(frozen=True, kw_only=True)
class RoundFire(Reward):
    """Each aircraft's own reward for its place at the fire's edge (Haksar and Schwager, IROS 2018; the numbers are
    those of the authors' public code).

    All of it reads the forest before the step, and the cell to which the aircraft comes. Neighbours beyond the map
    count as healthy. A move is taken to lead one cell far.

    Attributes:
        edge: Of a burning tree with a healthy one among its four neighbours.
        interior: Of a burning tree without.
        beside: Of a healthy tree with a burning or burnt one among its eight neighbours.
        far: Of a healthy tree without.
        crowded: Where it comes within a cell of the team-mate that was nearest to it, if that has a lower number.
        parted: Where it was within a cell of that one, and now is not.
        turn: Where the move does not lead counter-clockwise round the middle of the map.
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
        """Return what a cell (row, column) is worth, int64 [B, A, 2], float32 [B, A]."""
        burns, stands = is_burning(before.cells), is_tree(before.cells)
        codes = burns.to(torch.uint8) + (~burns & ~stands).to(torch.uint8) * 2
        seen = window(comes, before.cells.shape[1:], 1).of(codes).flatten(2)
        here, is_edge = seen[..., 4], (seen[..., 1::2] == 0).any(dim=-1)
        is_beside = (seen != 0).any(dim=-1)
        burning = torch.where(is_edge, self.edge, self.interior)
        healthy = torch.where(is_beside, self.beside, self.far)
        return burning * (here == 1) + healthy * (here == 0)

    def _company(self, before: WorldState, comes: Tensor) -> Tensor:
        """Return what the way to the team-mate that was nearest is worth, float32 [B, A]."""
        position, mate = before.vehicles.position, nearest_mate(before)
        theirs = position.gather(1, mate[..., None].expand(-1, -1, 2))
        was, now = ((each - theirs).square().sum(-1) <= 1 for each in (position, comes))
        is_later = torch.arange(mate.shape[1], device=mate.device) > mate
        return (self.crowded * now + self.parted * (was & ~now)) * is_later

    def _turn(self, before: WorldState, step: Tensor) -> Tensor:
        """Return what the direction of a step (rows, columns) is worth, int64 [B, A, 2], float32 [B, A]."""
        east, north = from_middle(before).unbind(-1)
        return self.turn * (east * -step[..., 0] - north * step[..., 1] <= 0.0)
