"""Baselines without coordination between agents."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    can_be_put_out,
    extinguish_or,
    idle_action,
    known_fire,
    move_towards,
    nearest_fire,
    nearest_marked,
    place,
    target_or_supply,
)
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.records import records_of
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.places import in_reach


class NoOp(Heuristic):
    """Stays, or if the team has no such action, chooses one without effect."""

    reads_map = False

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        return idle_action(mask, self.world.team)


class Random(Heuristic):
    """Draws uniformly among the actions that would do something; the same seed gives the same draws."""

    reads_map = False

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        draws = uniform(state.key, state.step, Stream.POLICY, tuple(mask.shape[1:]))
        return (draws + 1.0).mul_(mask).argmax(dim=-1)


class Local(Heuristic):
    """Sees only cells within Chebyshev distance ``radius``: extinguishes what it can reach, else goes to the nearest
    fire in sight, else searches the map: first the agents fan out, then each goes from one random point to the next.

    Where sight is limited (``sensing=sight``), its radius is the vehicle's sight, with all that hinders it.
    """

    reads_map = False
    radius = 5

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        sees, index = self._fire_in_sight(state)
        target = torch.where(sees[..., None], place(index, state), self._waypoint(state))
        return extinguish_or(move_towards(state, self.world, target_or_supply(state, self.world, target)), mask)

    def _fire_in_sight(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return whether each agent sees fire, bool [B, A], and the flat index of the nearest."""
        world = self.world
        if records_of(state) is not None:
            return nearest_marked(state, known_fire(state, world) & in_reach(state, world.sensing.reach(world.team)))
        distance, index = nearest_fire(state, can_be_put_out(state, world))
        return distance <= self.radius, index

    def _waypoint(self, state: WorldState) -> Tensor:
        """Return each agent's next search point, int64 [B, A, 2]: fanned out at first, then random."""
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
    """Extinguishes what it can reach, else goes to the nearest fire on the map."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        _, index = nearest_fire(state, can_be_put_out(state, self.world))
        target = target_or_supply(state, self.world, place(index, state))
        return extinguish_or(move_towards(state, self.world, target), mask)
