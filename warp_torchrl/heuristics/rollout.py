"""Planner that simulates each choice before it acts."""

from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import distance_to_cells
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.dispatch import Dispatch
from warp_torchrl.heuristics.heuristic import Heuristic, Worlds
from warp_torchrl.heuristics.imagining import CELLS, at_once, played, trees_saved
from warp_torchrl.heuristics.seeking import can_act_on_fire
from warp_torchrl.world.arrays.random import imagined_keys
from warp_torchrl.world.fires.imagined import imagined, rules_in_sight
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState


class Rollout(Heuristic):
    """Improves a base policy by simulation: the rollout algorithm, agent by agent.

    Agents decide one after the other. Each considers all actions that its mask allows, while the agents before it take
    their chosen actions and the agents after it follow the base policy. An action is simulated in the same ``samples``
    futures as the others, for ``horizon`` steps: after the first step all agents follow the base policy. Its gain is
    the number of trees that stand in the end, less the number if the agent, too, follows the base policy. An action
    replaces that of the base policy if its mean gain is more than ``errors`` standard errors above 0, by the most.

    Where sight is limited futures begin with worlds that may be the true ones as far as the team knows
    (``World.futures``). There it improves ``Dispatch``, of agents that can act on fire and are ``near`` one that they
    know; in the futures all then follow the base policy, which is faster.

    All actions are simulated in the first half of the futures, and only those with a gain there in the second.

    References: Tesauro and Galperin, "On-line policy improvement using Monte-Carlo search", NIPS 1996; Bertsekas,
    "Multiagent rollout algorithms and reinforcement learning", IEEE/CAA J. Autom. Sinica 2021.

    Args:
        env: The environment whose state it reads.
    """

    base: ClassVar[type[Heuristic]] = Coordinated
    """The base policy; it may read the state alone."""
    horizon: ClassVar[int] = 32  # steps
    samples: ClassVar[int] = 8  # imagined futures, at least 2
    near: ClassVar[int] = 4  # cells
    errors: ClassVar[float] = 1.0  # standard errors that a gain must exceed
    cells: ClassVar[int] = CELLS  # of the worlds that are imagined at once

    def __init__(self, env: Worlds) -> None:
        super().__init__(env)
        self.policy = self.base(env)
        self.dispatch = Dispatch(env)

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        believes = self.world.sensing.is_limited and not self.sees_all
        action = (self.dispatch if believes else self.policy).choose(state, mask)
        plans = self._near_fire(state) if believes else torch.ones_like(action, dtype=torch.bool)
        going = (~state.done & plans.any(dim=1)).nonzero()[:, 0]
        if not len(going):
            return action
        tries = (mask & plans[..., None])[going]
        return action.index_copy(0, going, self._plan(state[going], tries, action[going]))

    def _near_fire(self, state: WorldState) -> Tensor:
        """Return the agents that can act on fire, and are near one, bool [B, A]."""
        burns = (distance_to_cells(state) <= self.near) & is_burning(state.cells)[:, None]
        return burns.flatten(2).any(dim=2) & can_act_on_fire(self.world, burns.device)

    def _plan(self, state: WorldState, mask: Tensor, action: Tensor) -> Tensor:
        """Return better actions than these where there are any, int64 [B, A], of those that the mask allows."""
        keys = imagined_keys(state.key, state.step, self.samples)
        futures = imagined(self.world.futures(state, self.samples), keys.flatten(), self.world)
        saved = self._imagine(futures, torch.arange(len(action), device=action.device), action, range(self.samples))
        for agent in range(action.shape[1]):  # one after the other: each knows what those before it chose
            action, saved = self._improve(futures, mask[:, agent], action, saved, agent)
        return action

    def _improve(
        self, futures: WorldState, mask: Tensor, action: Tensor, saved: Tensor, agent: int
    ) -> tuple[Tensor, Tensor]:
        """Return the actions with a better one of an agent, and the trees that they save, as ``saved`` [B, samples]."""
        own = action[:, agent]
        row, option = mask.scatter(1, own[:, None], False).nonzero().unbind(dim=1)
        tried = action[row].index_copy(1, own.new_tensor([agent]), option[:, None])
        gain = saved.new_zeros(len(row), self.samples)
        left = torch.arange(len(row), device=row.device)
        half = self.samples // 2
        for begin, end in ((0, half), (half, self.samples)):
            if not len(left):
                break
            which = row[left]
            stand = self._imagine(futures, which, tried[left], range(begin, end))
            gain[left, begin:end] = stand - saved[which, begin:end]
            left = left[gain[left, :end].sum(dim=1) > 0]
        best = torch.zeros(mask.shape, dtype=torch.float64, device=mask.device)
        best[row[left], option[left]] = self._sure_gain(gain[left])
        gains = saved.new_zeros(*mask.shape, self.samples)
        gains[row, option] = gain
        found = best.max(dim=1)
        chosen = torch.where(found.values > 0.0, found.indices, own)
        index = chosen[:, None, None].expand(-1, 1, self.samples)
        action = action.index_copy(1, own.new_tensor([agent]), chosen[:, None])
        return action, saved + gains.gather(1, index)[:, 0]

    def _sure_gain(self, gain: Tensor) -> Tensor:
        """Return mean gains less ``errors`` standard errors, float64 [n], of gains int32 [n, samples].

        Sums are of whole numbers, so that they are the same in any batch.
        """
        count, total, squares = self.samples, gain.sum(dim=1), gain.to(torch.int64).square().sum(dim=1)
        variance = (squares * count - total.square()).to(torch.float64) / (count * (count - 1))
        return total.to(torch.float64) / count - self.errors * (variance / count).sqrt()

    def _imagine(self, futures: WorldState, row: Tensor, action: Tensor, which: range) -> Tensor:
        """Return the trees that stand after ``horizon`` steps, int32 [n, S].

        Args:
            futures: Imagined worlds, ``samples`` of each world, batch size [B * samples].
            row: The world that each action is tried in, int64 [n].
            action: Of the first step, int64 [n, A].
            which: The S of its futures in which it is tried.
        """
        world, count = rules_in_sight(self.world), len(which)
        saved = []
        for at in torch.arange(len(row) * count, device=row.device).split(at_once(futures, self.cells)):
            tried, future = at // count, at % count
            own = row[tried] * self.samples + which.start + future
            saved.append(played(world, futures[own], self.policy.choose, self.horizon, trees_saved, action[tried]))
        return torch.cat(saved).view(-1, count)
