"""Planner that simulates whole tactics before it follows one."""

from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.dispatch import Dispatch
from warp_torchrl.heuristics.heuristic import Heuristic, Worlds
from warp_torchrl.heuristics.imagining import CELLS, at_once, played
from warp_torchrl.heuristics.tactics import HeadAttack, PointProtection
from warp_torchrl.world.arrays.random import imagined_keys
from warp_torchrl.world.fires.imagined import imagined, rules_in_sight
from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.team.presence import on_scene

_TIE = 0.01
"""What the whole forest is worth beside the goal."""


class Switching(Heuristic):
    """Follows the tactic that does best in imagined fires: policy switching.

    Every ``period`` steps, once a vehicle is there, each tactic plays the same ``samples`` futures for ``horizon``
    steps. What it reaches is the world's goal, by ``Mechanic.degree`` where that is yes or no; where it is alike, the
    forest that stands. The team changes its tactic for the one whose mean gain, less ``errors`` standard errors, is
    largest and above 0. It begins as the first. ``Rollout`` tries single actions, and looks ahead too short for crews
    that build line for an hour.

    Where sight is limited futures begin with worlds that may be the true ones as far as the team knows
    (``World.futures``).

    Reference: Chang, Givan and Chong, "Parallel rollout for online solution of partially observable Markov decision
    processes", Discrete Event Dyn. Syst. 2004.

    Args:
        env: The environment whose state it reads.
    """

    is_stateful: ClassVar[bool] = True
    tactics: ClassVar[tuple[type[Heuristic], ...]] = (
        Dispatch,
        Coordinated,
        HeadAttack,
        PointProtection,
    )
    """Each reads the state alone; the first is that of the start."""
    period: ClassVar[int] = 30  # steps
    horizon: ClassVar[int] = 120  # steps
    samples: ClassVar[int] = 4  # imagined futures, at least 2
    errors: ClassVar[float] = 1.0  # standard errors that a gain must exceed
    cells: ClassVar[int] = CELLS  # of the worlds that are imagined at once

    def __init__(self, env: Worlds) -> None:
        super().__init__(env)
        self.policies = [kind(env) for kind in self.tactics]
        self._followed = torch.zeros(0, dtype=torch.int64)  # [B], the tactic of each world; empty before the first step

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        if len(self._followed) != len(mask):
            self._followed = torch.zeros(len(mask), dtype=torch.int64, device=mask.device)
        self._followed = self._followed.masked_fill(state.step == 0, 0)
        there = on_scene(state)
        acts = ~state.done if there is None else ~state.done & there.any(dim=1)
        due = (acts & (state.step % self.period == 0)).nonzero()[:, 0]
        if len(due):
            self._followed[due] = self._best(state[due], self._followed[due])
        action = mask.new_zeros(mask.shape[:2], dtype=torch.int64)
        for number, policy in enumerate(self.policies):
            rows = (self._followed == number).nonzero()[:, 0]
            if len(rows):
                action[rows] = policy.choose(state[rows], mask[rows])
        return action

    def _best(self, state: WorldState, followed: Tensor) -> Tensor:
        """Return the tactics to follow from now on, int64 [B], in place of those that are followed."""
        keys = imagined_keys(state.key, state.step, self.samples)
        futures = imagined(self.world.futures(state, self.samples), keys.flatten(), self.world)
        world = rules_in_sight(self.world)
        parts = torch.arange(len(futures.key), device=state.key.device).split(at_once(futures, self.cells))

        def ends(policy: Heuristic) -> Tensor:
            told = [played(world, futures[part], policy.choose, self.horizon, self._reached) for part in parts]
            return torch.cat(told).view(-1, self.samples)

        reached = torch.stack([ends(policy) for policy in self.policies], dim=1)
        gain = reached - reached.gather(1, followed[:, None, None].expand(-1, 1, self.samples))
        sure = gain.mean(dim=2) - self.errors * gain.std(dim=2) / self.samples**0.5
        best = sure.max(dim=1)
        return torch.where(best.values > 0.0, best.indices, followed)

    def _reached(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return how much of the goal each world has reached, more is better, float64 [n]."""
        saved, goal = counts.saved().to(torch.float64), self.world.goal
        if goal is None:
            return saved
        for each in self.world.loop:
            degree = each.degree(state, goal)
            if degree is not None:
                return degree.to(torch.float64) + _TIE * saved
            for row in each.metric_rows(self.world):
                if row.name == goal:
                    value = each.metrics(state)[goal].to(torch.float64)
                    return (-value if row.better == "less" else value) + _TIE * saved
        return saved
