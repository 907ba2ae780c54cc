"""The team shuts the fire in with firebreaks."""

import math

import torch
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics.base import approach, claim_cells, extinguish_or, list_cells, or_refill
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.world.fast.distances import distance_to_nearest
from warp_torchrl.world.geometry import grow
from warp_torchrl.world.state import Action, WorldState, is_burning, is_tree


class Ring(Coordinated):
    """Clears a ring about the fire, at the distance at which it can be closed in time; where several fires are near
    each other it goes round them all. When the fire gets over it, a wider one is planned; when it is closed, or none
    can be, agents that have water attack the front as ``Coordinated`` does, and so do those that cannot clear.
    """

    remembers = True
    pace = 1.0  # cells that a front makes in one of the paper's ticks
    effort = 2.0  # steps for each cell of the ring: go there, clear it

    def __init__(self, env: WildfireEnv) -> None:
        super().__init__(env)
        self._plan = torch.zeros(0, dtype=torch.bool)  # [B, H, W], the ring; empty before the first step
        self._inside = torch.zeros(0, dtype=torch.bool)  # [B, H, W], what it encloses

    def diggers(self, state: WorldState) -> Tensor:
        """Return which agents work on the ring, bool [A]."""
        return self.env.world.team.table(state.cells.device).can["clear"]

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        self._revise(state)
        todo = self._plan & is_tree(state.cells) & (state.alpha > 0.0)
        digs = self.diggers(state) & todo.flatten(1).any(dim=1)[:, None]
        value, front = self.value(state)
        cells, valid = list_cells(todo | front)
        worth = value.flatten(1).gather(1, cells).masked_fill_(~(front.flatten(1).gather(1, cells) & valid), -math.inf)
        unbroken = torch.zeros_like(worth).masked_fill_(~(todo.flatten(1).gather(1, cells) & valid), -math.inf)
        worth = torch.where(digs[..., None], unbroken[:, None], worth[:, None])
        claims = claim_cells(state, cells, worth, elbow_room=1, discount=2.0, taken=1000.0)
        attack = extinguish_or(approach(state, self.env, or_refill(state, self.env, claims)), mask)
        there = (claims == state.vehicles.position).all(dim=-1) & mask[..., Action.CLEAR]
        dig = torch.where(there, int(Action.CLEAR), approach(state, self.env, claims))
        return torch.where(digs, dig, attack)

    def _revise(self, state: WorldState) -> None:
        """Plan a ring in worlds that begin, and where the fire has got over the one there was."""
        burning = is_burning(state.cells)
        if self._plan.shape != burning.shape:
            self._plan, self._inside = torch.zeros_like(burning), torch.zeros_like(burning)
        stale = (state.step == 0) | (burning & ~self._inside).flatten(1).any(dim=1)
        index = stale.nonzero()[:, 0]
        if len(index):
            self._plan[index], self._inside[index] = self._lay(state[index], burning[index])

    def _lay(self, state: WorldState, burning: Tensor) -> tuple[Tensor, Tensor]:
        """Return the nearest ring that can be closed in time and what it encloses; none where none can be."""
        world = self.env.world
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
        farthest = distance_to_nearest(state.vehicles.position, burning).amax(dim=1)
        way = farthest[:, None] - distance
        workers = self.diggers(state).sum().clamp(min=1)
        need = way.clamp(min=0) + self.effort * cells[:, 1:reach] / workers
        steps = world.steps_per_tick * world.fire.ticks_per_stage / self.pace
        fits = need <= (distance - 1) * steps
        nearest_ring = torch.where(fits.any(dim=1), distance[fits.to(torch.uint8).argmax(dim=1)], 0)[:, None, None]
        return (away == nearest_ring) & (nearest_ring > 0), away < nearest_ring


class Mixed(Ring):
    """Every other agent that can clear works on the ring; the others attack the front."""

    def diggers(self, state: WorldState) -> Tensor:
        """Return which agents work on the ring, bool [A]."""
        clears = super().diggers(state)
        return clears & (clears.cumsum(0) % 2 == 1)
