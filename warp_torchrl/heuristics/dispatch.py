"""Baseline that assigns agents by the length of their paths."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    agent_distance,
    extinguish_or,
    idle_action,
    list_cells,
    match_cells,
    place,
    target_or_base,
)
from warp_torchrl.heuristics.coordinated import Coordinated
from warp_torchrl.heuristics.firebreaks import cells_to_clear
from warp_torchrl.world.arrays.detours import moves_around, moves_from
from warp_torchrl.world.arrays.distances import FAR
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Action, Cover, WorldState
from warp_torchrl.world.team.abilities import AgentContext, Extinguish, own_cell, places
from warp_torchrl.world.team.acting import is_second
from warp_torchrl.world.team.supply import mark_base

_LAST = 4096.0
"""By how much less cells are worth to agents that cannot extinguish: they choose after the others."""


class Dispatch(Coordinated):
    """Assigns the fire front as ``Coordinated`` does, but by the moves that agents need, around lakes and fire.

    Where team-mates would extinguish one cell in the same step, the first does so and the others move on. Agents with
    empty tanks claim no fire: they go where the path to water, and from there to the fire, is shortest. Agents that can
    clear and never extinguish, as in teams without water, enclose the fire with firebreaks (``cells_to_clear``). Agents
    without a target wait.
    """

    effort = 2.0  # steps for each cell of a firebreak: move, clear

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        clears = self._clears()
        if not any(clears):
            return self._attack(state, mask)
        who = torch.tensor(clears, device=mask.device)
        clear = self._clear(state, mask, who)
        return clear if all(clears) else torch.where(who, clear, self._attack(state, mask))

    def _clears(self) -> list[bool]:
        """Return which agents clear firebreaks."""
        team = self.world.team
        kinds = [ROLES[role].abilities for role in team.agent_roles]
        return ["clear" in each and (team.tank == 0 or "extinguish" not in each) for each in kinds]

    def _attack(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions of agents that extinguish, int64 [B, A]."""
        world, tank = self.world, state.vehicles.tank
        table = world.team.table(mask.device)
        value, front = self.value(state)
        cells, valid = list_cells(front)
        gain = value.flatten(1).gather(1, cells)[:, None] - self._distance(state, cells)
        gain = gain - _LAST * ~table.can["extinguish"][:, None]
        gain = gain.masked_fill(~valid[:, None] | (tank == 0)[..., None], -math.inf)
        claims = match_cells(state, cells, gain, spacing=3, discount=6.0, taken=1000.0)
        move = self._move(state, mask, self._target_or_water(state, claims, front))
        nearby, _ = Extinguish.nearby_fire(AgentContext(state, table, 1.0, world.fire.last_spreading))
        second = is_second(nearby, mask[..., Action.EXTINGUISH])
        return torch.where(second, move, extinguish_or(move, mask))

    def _clear(self, state: WorldState, mask: Tensor, who: Tensor) -> Tensor:
        """Return the actions of some agents, bool [A], that clear firebreaks, int64 [B, A]."""
        todo = cells_to_clear(state, self.world, who, self.effort)
        cells, valid = list_cells(todo)
        gain = (-self._distance(state, cells)).masked_fill(~(valid[:, None] & who[:, None]), -math.inf)
        claims = match_cells(state, cells, gain, spacing=1, discount=2.0, taken=1000.0)
        own = own_cell(state)
        here = todo.flatten(1).gather(1, own) & mask[..., Action.CLEAR]
        move = self._move(state, mask, claims)
        return torch.where(here & ~is_second(own, here), int(Action.CLEAR), move)

    def _open(self, state: WorldState) -> Tensor:
        """Return the cells that each agent can enter now, bool [B, A, H, W]: no lakes or fire, unless it flies."""
        return _is_open(state)[:, None] | self.world.team.table(state.cells.device).flies[:, None, None]

    def _distance(self, state: WorldState, cells: Tensor) -> Tensor:
        """Return each agent's path length to cells [B, K], float32 [B, A, K] [cells]; ``FAR`` or more without a path.

        Aircraft, whose moves are longer, have no advantage by it: they would claim what others are at already.
        """
        moves = moves_around(own_cell(state), self._open(state), cells[:, None])
        return torch.where(moves == FAR, FAR + agent_distance(state, cells), moves)

    def _target_or_water(self, state: WorldState, target: Tensor, front: Tensor) -> Tensor:
        """Return the given targets, or water for agents whose tank is empty, or the base where charge runs out.

        int64 [B, A, 2].
        """
        target = target_or_base(state, self.world, target)
        if not self.world.team.tank:
            return target
        water, valid = list_cells(mark_base(state, state.cover == int(Cover.LAKE)))
        way = self._distance(state, water) + moves_from(front, _is_open(state), water)[:, None]
        nearest = way.masked_fill_(~valid[:, None], math.inf).argmin(dim=-1)
        is_empty = (state.vehicles.tank == 0)[..., None]
        return torch.where(is_empty, place(water.gather(1, nearest), state), target)

    def _move(self, state: WorldState, mask: Tensor, target: Tensor) -> Tensor:
        """Return the first move of a shortest path to each agent's target, int64 [B, A]; at the target, wait.

        Of ways that are as short, the one whose first move leads nearest to the target, by rows and columns together.
        """
        team = self.world.team
        step = offsets(mask.device) * team.table(mask.device).stride[:, None, None]
        reached, _ = places(state, step)
        goal = target[..., 0] * state.cells.shape[2] + target[..., 1]
        gap = (state.vehicles.position[:, :, None] + step - target[:, :, None]).abs().to(torch.float32)
        can = self.world.open_moves(state)
        moves = moves_around(goal, self._open(state), torch.where(can, reached, goal[..., None]))  # open moves alone
        way = torch.where(moves == FAR, FAR + gap.amax(dim=-1), moves) + 0.01 * gap.sum(dim=-1)
        move = way.masked_fill_(~can, math.inf).argmin(dim=-1)
        waits = (goal == own_cell(state)) & ~is_burning(state.cells.flatten(1).gather(1, goal))
        return torch.where(waits | ~can.any(dim=-1), idle_action(mask, team), move)


def _is_open(state: WorldState) -> Tensor:
    """Return the cells that ground vehicles can enter now, bool [B, H, W]: no lakes, and no fire."""
    return ~((state.cover == int(Cover.LAKE)) | is_burning(state.cells))
