"""Baselines in which each agent acts for itself."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    Heuristic,
    approach,
    can_be_put_out,
    extinguish_or,
    idle_action,
    nearest_fire,
    or_refill,
    place,
)
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import WorldState


class NoOp(Heuristic):
    """Does nothing: stays, or where the team cannot stay, chooses an action that has no effect."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        return idle_action(mask, self.env.world.team)


class Random(Heuristic):
    """Draws one of the actions that do something, the same ones on the same seed."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        draws = uniform(state.key, state.step, Stream.POLICY, tuple(mask.shape[1:]))
        return (draws + 1.0).mul_(mask).argmax(dim=-1)


class Local(Heuristic):
    """Sees only the square of ``radius`` cells about itself: puts out what it can reach, else goes to the nearest
    fire it sees, else sweeps the map, first fanning out across it and then from one random point to the next.
    """

    radius = 5

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        fire = can_be_put_out(state, self.env)
        distance, index = nearest_fire(state, fire)
        sees = distance <= self.radius
        target = torch.where(sees[..., None], place(index, state), self._waypoint(state))
        return extinguish_or(approach(state, self.env, or_refill(state, self.env, target)), mask)

    def _waypoint(self, state: WorldState) -> Tensor:
        """Return where each agent sweeps to, int64 [B, A, 2]: fanning out over the map, later random points."""
        size = torch.tensor(state.cells.shape[1:], device=state.cells.device)
        agents = state.vehicles.position.shape[1]
        leg = state.step // size.max()
        anywhere = uniform(state.key, leg, Stream.POLICY, (agents, 2))
        turn = (torch.arange(agents, device=size.device) + 0.5) / agents
        across = torch.stack((2.0 * turn, 2.0 - 2.0 * turn), dim=-1).clamp_(max=1.0)
        across = torch.where(state.vehicles.base[:, None] > 0, 1.0 - across, across)
        point = torch.where((leg == 0)[:, None, None], across, anywhere)
        return (point * (size - 1)).round_().to(torch.int64)


class Greedy(Heuristic):
    """Puts out what it can reach, else goes to the nearest fire of the map."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        _, index = nearest_fire(state, can_be_put_out(state, self.env))
        target = or_refill(state, self.env, place(index, state))
        return extinguish_or(approach(state, self.env, target), mask)
