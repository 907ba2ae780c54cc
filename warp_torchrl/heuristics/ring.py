"""Baselines that enclose the fire with firebreaks."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    claim_cells,
    extinguish_or,
    move_towards,
    target_or_supply,
)
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.heuristic import Worlds
from warp_torchrl.world.arrays.distances import distance_to_nearest
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.team.presence import those_there


class Ring(Coordinated):
    """Clears a ring around the fires, at the smallest distance at which it can be closed in time. If fire crosses the
    ring, it plans a wider one. Agents that cannot clear attack the front as ``Coordinated`` does, and so do all agents
    once the ring is closed, or if none is possible.
    """

    is_stateful = True
    pace = 1.0  # speed of a fire front [cells per tick of the paper]
    effort = 2.0  # steps for each cell of the ring: move, clear

    def __init__(self, env: Worlds) -> None:
        super().__init__(env)
        self._plan = torch.zeros(0, dtype=torch.bool)  # [B, H, W], the ring; empty before the first step
        self._inside = torch.zeros(0, dtype=torch.bool)  # [B, H, W], what it encloses

    def line_builders(self, state: WorldState) -> Tensor:
        """Return the agents that clear the ring, bool [A]."""
        return self.world.team.table(state.cells.device).can["clear"]

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        self._update_plan(state)
        todo = self._plan & is_tree(state.cells) & (state.alpha > 0.0)
        builds = those_there(state, self.line_builders(state)) & todo.flatten(1).any(dim=1)[:, None]
        value, front = self.value(state)
        cells, valid = list_cells(todo | front)
        worth = value.flatten(1).gather(1, cells).masked_fill_(~(front.flatten(1).gather(1, cells) & valid), -math.inf)
        unbroken = torch.zeros_like(worth).masked_fill_(~(todo.flatten(1).gather(1, cells) & valid), -math.inf)
        worth = torch.where(builds[..., None], unbroken[:, None], worth[:, None])
        claims = claim_cells(state, cells, worth, spacing=1, discount=2.0, taken=1000.0)
        attack = extinguish_or(move_towards(state, self.world, target_or_supply(state, self.world, claims)), mask)
        there = (claims == state.vehicles.position).all(dim=-1) & mask[..., Action.CLEAR]
        build = torch.where(there, int(Action.CLEAR), move_towards(state, self.world, claims))
        return torch.where(builds, build, attack)

    def _update_plan(self, state: WorldState) -> None:
        """Plan a ring in worlds at step 0, and where fire has crossed the former ring."""
        burning = is_burning(state.cells)
        if self._plan.shape != burning.shape:
            self._plan, self._inside = torch.zeros_like(burning), torch.zeros_like(burning)
        stale = (state.step == 0) | (burning & ~self._inside).flatten(1).any(dim=1)
        index = stale.nonzero()[:, 0]
        if len(index):
            self._plan[index], self._inside[index] = self._plan_ring(state[index], burning[index])

    def _plan_ring(self, state: WorldState, burning: Tensor) -> tuple[Tensor, Tensor]:
        """Return the smallest ring that can be closed in time, and the cells inside; both empty if there is none."""
        world = self.world
        reach = max(burning.shape[1:]) // 2
        away = torch.full(burning.shape, reach, device=burning.device)  # cells to the fire, ``reach`` at most
        fire = burning
        for moves in range(reach):
            away = torch.where(fire & (away == reach), moves, away)
            fire = grow(fire)
        fuel = is_tree(state.cells) & (state.alpha > 0.0)
        cells = torch.zeros(len(burning), reach + 1, device=burning.device)
        cells.scatter_add_(1, away.flatten(1), fuel.flatten(1).to(cells.dtype))
        distance = torch.arange(1, reach, device=burning.device)
        ways = distance_to_nearest(state.vehicles.position, burning)
        there = those_there(state, torch.ones_like(ways, dtype=torch.bool))
        farthest = ways.masked_fill(~there, 0).amax(dim=1)
        way = farthest[:, None] - distance
        workers = those_there(state, self.line_builders(state)).sum(dim=-1, keepdim=True).clamp(min=1)
        need = way.clamp(min=0) + self.effort * cells[:, 1:reach] / workers
        steps = world.steps_per_tick * world.fire.ticks_per_stage / self.pace
        fits = need <= (distance - 1) * steps
        nearest_ring = torch.where(fits.any(dim=1), distance[fits.to(torch.uint8).argmax(dim=1)], 0)[:, None, None]
        return (away == nearest_ring) & (nearest_ring > 0), away < nearest_ring


class Mixed(Ring):
    """Every second agent that can clear works on the ring; the others attack the front."""

    def line_builders(self, state: WorldState) -> Tensor:
        """Return the agents that clear the ring, bool [A]."""
        clears = super().line_builders(state)
        return clears & (clears.cumsum(0) % 2 == 1)
