"""Baseline that assigns agents by the length of their paths."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import (
    base_or_water,
    extinguish_or,
    match_cells,
    place,
    steps_here,
    steps_to_clear,
    steps_to_put_out,
    target_or_base,
)
from warp_torchrl.heuristics.coordinated import LAST, Coordinated
from warp_torchrl.heuristics.firebreaks import cells_to_clear
from warp_torchrl.heuristics.paths import first_move, is_open, path_length
from warp_torchrl.world.arrays.blocks import sums_about
from warp_torchrl.world.arrays.detours import moves_from
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.fires.ahead import worth_ahead
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Action, Cover, WorldState
from warp_torchrl.world.team.abilities import AgentContext, Extinguish, own_cell
from warp_torchrl.world.team.acting import is_second
from warp_torchrl.world.team.supply import mark_base

_ABOUT = 3
"""Cells about each other whose worth counts together."""


class Dispatch(Coordinated):
    """Assigns the fire front as ``Coordinated`` does, but by the moves that agents need, around lakes and fire.

    Where team-mates would extinguish one cell in the same step, the first does so and the others move on. Agents with
    empty tanks claim no fire: they go where the path to water, and from there to the fire, is shortest. Agents that can
    clear and never extinguish, as in teams without water, enclose the fire with firebreaks (``cells_to_clear``). Agents
    without a target wait.

    Where work takes time (``Mechanic.steps_to_put_out``), a cell costs an agent the steps of its way, and ``labour``
    times those that it alone would take there; fires at whose flames it cannot work come last. Agents work at one cell
    together, and clear their own cell where that is sooner done than half of putting out the fire beside it.
    """

    worth_weight = 60.0  # of the cell ahead of which most worth lies [cells of distance]
    labour = 2.0  # steps of way for each of work
    effort = 2.0  # steps for each cell of a firebreak: move, clear; where lines take time, their steps and the move

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        clears = self._clears()
        if not any(clears):
            return self._attack(state, mask)
        who = torch.tensor(clears, device=mask.device)
        clear = self._clear(state, mask, who)
        return clear if all(clears) else torch.where(who, clear, self._attack(state, mask))

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return each cell's value [cells of distance], float32 [B, H, W], and the fire front, bool [B, H, W].

        Where worlds are compared by the worth that is left, what lies ahead of each cell is added: the most that
        fire there would come to within a few cells of each other.
        """
        value, front = super().value(state)
        worth = state.plane("values", "worth")
        if worth is None or self.world.goal != "worth_saved":
            return value, front
        ahead = worth_ahead(state, self.world, sums_about(worth, _ABOUT))
        most = (ahead * front).flatten(1).amax(dim=1).clamp(min=1e-9)[:, None, None]
        return value + self.worth_weight * ahead / most, front

    def worth(self, state: WorldState, value: Tensor, cells: Tensor) -> Tensor:
        """Return the value of cells, flat indices int64 [B, K], for each agent, float32 [B, 1 or A, K]."""
        return value.flatten(1).gather(1, cells)[:, None]

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
        gain = self.worth(state, value, cells) - self.steps_to(state, cells)
        gain = gain - LAST * ~table.can["extinguish"][:, None]
        gain = gain.masked_fill(~valid[:, None] | (tank == 0)[..., None], -math.inf)
        claims = match_cells(state, cells, gain, spacing=3, discount=6.0, taken=1000.0)
        move = first_move(state, self.world, mask, self._target_or_water(state, claims, front))
        nearby, is_beside = Extinguish.nearby_fire(AgentContext(state, table, 1.0, world.fire.last_spreading))
        takes = steps_here(state, world)
        if takes is None:
            second = is_second(nearby, mask[..., Action.EXTINGUISH])
            return torch.where(second, move, extinguish_or(move, mask))
        fire, line = takes
        goes_on = state.vehicles.last_action == int(Action.CLEAR)
        clears = mask[..., Action.CLEAR] & (goes_on | (is_beside & (2.0 * line < fire)))
        return torch.where(clears, int(Action.CLEAR), extinguish_or(move, mask))

    def steps_to(self, state: WorldState, cells: Tensor) -> Tensor:
        """Return what cells cost each agent, float32 [B, A, K] [cells of way]."""
        way, work = path_length(state, self.world, cells), steps_to_put_out(state, self.world, cells)
        if work is None:
            return way
        stride = self.world.team.table(cells.device).stride[:, None]
        return way / stride + torch.where(torch.isfinite(work), self.labour * work, LAST)

    def _clear(self, state: WorldState, mask: Tensor, who: Tensor) -> Tensor:
        """Return the actions of some agents, bool [A], that clear firebreaks, int64 [B, A]."""
        steps = steps_to_clear(state, self.world)
        todo = cells_to_clear(state, self.world, who, self.effort if steps is None else steps + 1.0)
        cells, valid = list_cells(todo)
        gain = (-path_length(state, self.world, cells)).masked_fill(~(valid[:, None] & who[:, None]), -math.inf)
        claims = match_cells(state, cells, gain, spacing=1, discount=2.0, taken=1000.0)
        own = own_cell(state)
        can = mask[..., Action.CLEAR]
        goes_on = can & who & (state.vehicles.last_action == int(Action.CLEAR))  # a line that takes several steps
        here = todo.flatten(1).gather(1, own) & can
        move = first_move(state, self.world, mask, claims)
        return torch.where((here & ~is_second(own, here)) | goes_on, int(Action.CLEAR), move)

    def _target_or_water(self, state: WorldState, target: Tensor, front: Tensor) -> Tensor:
        """Return the given targets, or water for agents whose tank is empty, or the base where charge runs out.

        int64 [B, A, 2].
        """
        target = target_or_base(state, self.world, target)
        if not self.world.team.tank:
            return target
        water, valid = list_cells(mark_base(state, state.cover == int(Cover.LAKE)))
        way = path_length(state, self.world, water) + moves_from(front, is_open(state), water)[:, None]
        nearest = way.masked_fill_(~valid[:, None], math.inf).argmin(dim=-1)
        is_empty = (state.vehicles.tank == 0)[..., None]
        return torch.where(is_empty, base_or_water(state, self.world, place(water.gather(1, nearest), state)), target)
