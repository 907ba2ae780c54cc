"""Baseline that watches: targeted observations, where they lower the variance of what is believed most."""

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    agent_distance,
    extinguish_or,
    idle_action,
    match_cells,
    move_towards,
    target_or_supply,
)
from warp_torchrl.heuristics.heuristic import Heuristic
from warp_torchrl.world.arrays.blocks import sums_about
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState

_SETTLING = 8.0
"""Steps that a target costs beside its way."""
_AHEAD = 0.5
"""What the variance after the next tick counts for, at a cell that is reached before it."""
_APART = 2.3
"""By how much less, as a logarithm, a place is worth that a team-mate will see."""
_LEAST = 1e-9
_TAKEN = 1000.0


class Targeted(Heuristic):
    """Goes where seeing lowers the variance of what is believed most, a step of way, apart from the others.

        score = log(V + V' / 2) - log(steps + 8)    if it arrives before the next tick of the fire
        score = log(V') - log(steps + 8)            else

    V is the worth of the cells in sight from there (``World.worth_seeing``): with a belief the variance p (1 - p) of
    its members, and the chance of a hidden fire; without one, how stale records are. V' is the variance that the next
    tick adds: p (1 - p) with the chance p that a cell burns after it, on the map that the agent assumes. What is seen
    is certain until then. The term is that of weather forecasts, whose aircraft fly to where observations reduce the
    ensemble's variance most (Bishop, Etherton and Majumdar 2001). The score is ours. It extinguishes what it can.
    """

    reads_map = False

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        world, agents = self.world, mask.shape[1]
        now, later = (self._in_sight(each, agents) for each in (world.worth_seeing(state), self._after_tick(state)))
        cells = torch.arange(now.shape[2], device=mask.device).expand(len(mask), -1)
        steps = (agent_distance(state, cells) / world.team.table(mask.device).stride[:, None]).ceil()
        left = (world.steps_per_tick - state.step % world.steps_per_tick)[:, None, None]
        drop = torch.where(steps <= left, now + _AHEAD * later, later)
        gain = drop.clamp(min=_LEAST).log() - (steps + _SETTLING).log()
        target = match_cells(state, cells, gain, spacing=2 * max(self._sights()), discount=_APART, taken=_TAKEN)
        move = move_towards(state, world, target_or_supply(state, world, target))
        waits = (target == state.vehicles.position).all(dim=-1)
        return extinguish_or(torch.where(waits, idle_action(mask, world.team), move), mask)

    def _after_tick(self, state: WorldState) -> Tensor:
        """Return the variance that the next tick of the fire adds, float32 [B, 1 or A, H, W]."""
        assumed = self.world.assumed(state)
        p = self.world.forecast(assumed).ignition_probability.masked_fill(is_burning(assumed.cells), 1.0)
        return (p * (1.0 - p)).unflatten(0, (len(state.key), -1))

    def _in_sight(self, worth: Tensor, agents: int) -> Tensor:
        """Return sums of maps [B, 1 or A, H, W] over what each agent sees from each cell, float32 [B, A, H * W]."""
        sights = self._sights()
        about = {each: sums_about(worth, each).flatten(2).expand(-1, agents, -1) for each in dict.fromkeys(sights)}
        return torch.stack([about[each][:, agent] for agent, each in enumerate(sights)], dim=1)

    def _sights(self) -> list[int]:
        """Return how far each agent sees [cells], at most the map's side."""
        return [min(each, max(self.world.size)) for each in self.world.sensing.reach(self.world.team)]
