"""The hand-made heuristic of Haksar and Schwager."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import extinguish_or, idle_action
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.world.arrays.geometry import offsets, unit_vectors
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.places import approach_move, from_middle, has_reached, nearest_mate

_MANY = 6
"""Healthy trees about a cell from which it is too far from the fire."""


class Clockwise(Heuristic):
    """Flies to the middle of the map until it is over the fire, then clockwise round the middle along the fire's edge.

    Source: Haksar and Schwager, "Distributed Deep Reinforcement Learning for Fighting Forest Fires with a Network of
    Aerial Robots", IROS 2018, and the authors' public code.

    Of the eight moves it takes the one that turns most clockwise, with two exceptions. If one of the two moves next to
    it on the left, which lead outwards, reaches a burning tree, or else a burnt one, it takes that move. If it would
    reach a healthy tree among six others or more, it takes the move next to it on the right. It stays where it would be
    within a cell of the team-mate nearest to it, if that has a lower number. It sees the 5 x 5 cells about it, its
    team-mates, and the middle of the map; beyond the map all is healthy.

    A move that leads off the map, where the authors' aircraft can go, is made along the border. Vehicles that can
    extinguish do so first.
    """

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        team = self.world.team
        turn = self._round_the_fire(state)
        mate = nearest_mate(state)
        at = state.vehicles.position
        theirs = at.gather(1, mate[..., None].expand(-1, -1, 2))
        gap = (at + offsets(at.device)[turn] - theirs).square().sum(-1)
        yields = (gap <= 1) & (torch.arange(at.shape[1], device=at.device) > mate)
        idle = idle_action(mask, team)
        way = torch.where(has_reached(state), torch.where(yields, -1, turn), approach_move(state))
        return extinguish_or(torch.where((way >= 0) & (way < 8), self._on_map(state, way, mask, idle), idle), mask)

    @staticmethod
    def _round_the_fire(state: WorldState) -> Tensor:
        """Return the move of each agent that is at the fire, int64 [B, A], a direction 0..7."""
        east, north = from_middle(state)[..., None, :].unbind(-1)
        along = unit_vectors(east.device)
        ahead = (east * along[:, 1] - north * along[:, 0]).argmin(dim=-1)
        burns = is_burning(state.cells)
        burnt = (state.burned != 0) & (state.cells == 0)
        seen = window(state.vehicles.position, state.cells.shape[1:], 2).of(burns.to(torch.uint8) + 2 * burnt)
        row, column = offsets(ahead.device).unbind(1)
        at = seen[..., 2 + row, 2 + column]  # by direction, [B, A, 8]
        healthy = (seen == 0).to(torch.int64).unfold(-2, 3, 1).unfold(-2, 3, 1).sum((-2, -1))  # in each 3 x 3
        about = healthy[..., 1 + row, 1 + column] - (at == 0).to(torch.int64)

        def of(plane: Tensor, direction: Tensor) -> Tensor:
            return plane.gather(-1, (direction % 8)[..., None])[..., 0]

        move = torch.where((of(at, ahead) == 0) & (of(about, ahead) >= _MANY), ahead + 1, ahead)
        for kind in (2, 1):  # the last has the last word: fire before burnt trees, and the outer move before the inner
            for left in (1, 2):
                move = torch.where(of(at, ahead - left) == kind, ahead - left, move)
        return move % 8

    def _on_map(self, state: WorldState, way: Tensor, mask: Tensor, idle: Tensor) -> Tensor:
        """Return moves unchanged where they are open, else along the border, else none, int64 [B, A]."""
        height, width = state.cells.shape[1:]
        stride = self.world.team.table(way.device).stride[:, None]
        at, toward = state.vehicles.position, offsets(way.device)
        row, column = (at + toward[way.clamp(0, 7)] * stride).unbind(-1)
        inside = torch.stack((row.clamp(0, height - 1), column.clamp(0, width - 1)), dim=-1)
        short = ((inside - at) // stride).sign()
        is_it = (short[..., None, :] == toward).all(dim=-1)
        move = is_it.to(torch.uint8).argmax(dim=-1)
        is_open = is_it.any(dim=-1) & mask.gather(-1, move[..., None])[..., 0]
        return torch.where(is_open, move, idle)
