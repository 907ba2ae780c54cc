"""Actions of a team: its abilities, the rules that bind moves, and the effects of acts on the worlds."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import scatter_add
from warp_torchrl.world.state.role import RoleTable
from warp_torchrl.world.state.state import ActionResult, WorldState
from warp_torchrl.world.team.abilities import Ability, AgentContext, Effect


class Attempts(NamedTuple):
    """What agents are about to do once they have moved, [B, A] each."""

    action: Tensor  # int64, as chosen
    running: Tensor  # bool [B, 1], worlds that go on; in others nobody does anything
    origin: Tensor  # int64 [B, A, 2], where each was before the moves (row, column)
    moved: Tensor  # bool, changed cell
    acts: Tensor  # bool, changes its target
    target: Tensor  # int64, flat index of the cell
    takes_water: Tensor  # bool, empties a tank that is limited by one
    is_useful: Tensor  # bool, is of use though it changes no cell


AgentEffect = tuple[Tensor, Mapping[str, Tensor | int]]
"""Which agents' acts have an effect, bool [B, A], and what planes of the state hold at their targets afterwards."""
TakeEffect = Callable[[WorldState, Attempts], tuple[WorldState, ActionResult]]
"""Lets attempts take effect: returns the worlds after it, and what each action came to."""


class TeamRule(Protocol):
    """Rules for vehicles beside their abilities; see ``world.mechanics.Mechanic``."""

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions], of those that the agents' abilities allow."""
        ...

    def around(self, state: WorldState, attempts: Attempts, take_effect: TakeEffect) -> tuple[WorldState, ActionResult]:
        """Return worlds after the attempts that it lets take effect, and what each action came to."""
        ...

    def grounded(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which agents cannot move, bool [B, A]; None where it keeps none."""
        ...

    def moved(self, state: WorldState, roles: RoleTable, running: Tensor) -> WorldState:
        """Return worlds after the agents' moves, in those that go on, bool [B]."""
        ...


class TeamAbility(NamedTuple):
    """An ability of a team."""

    name: str
    ability: Ability
    first: int  # code of its first action
    of_all: bool  # whether every agent has it

    def is_chosen(self, action: Tensor) -> Tensor:
        """Return where an action belongs to the ability, bool, shape of the actions, int64."""
        count = len(self.ability.actions)
        if count == 1:
            return action == self.first
        below = action < self.first + count
        return below & (action >= self.first) if self.first else below

    def act(self, now: AgentContext, action: Tensor) -> tuple[Tensor, Effect]:
        """Return which agents' actions of the ability would have an effect, bool [B, A], and the effects."""
        count = len(self.ability.actions)
        choice = (action - self.first if self.first else action).clamp(0, count - 1) if count > 1 else action
        effect = self.ability.act(now, choice)
        return effect.possible if self.of_all else effect.possible & now.roles.can[self.name], effect

    def mask(self, now: AgentContext, rules: Sequence[TeamRule]) -> Tensor:
        """Return which of its actions would have an effect under some rules, bool [B, A, actions]."""
        mask = self.ability.mask(now)
        if self.ability.moves:
            for grounded in grounded_by(rules, now):
                mask = mask & ~grounded[..., None]
        return mask if self.of_all else mask & now.roles.can[self.name][:, None]


def grounded_by(rules: Sequence[TeamRule], now: AgentContext) -> list[Tensor]:
    """Return which agents cannot move by each rule that keeps some where they are, bool [B, A] each."""
    found = (rule.grounded(now.state, now.roles) for rule in rules)
    return [each for each in found if each is not None]


def changed(state: WorldState, target: Tensor, effects: Sequence[AgentEffect]) -> WorldState:
    """Return worlds with what credited acts make of their targets, int64 [B, A].

    It is written as sums of differences, so that the order of the agents does not matter.

    Args:
        state: The worlds before.
        target: Flat index of the cell of each agent's act.
        effects: Of each ability the agents whose act is credited, bool [B, A], and what planes hold there afterwards.
    """
    planes = {name: getattr(state, name) for _, becomes in effects for name in becomes}
    after = {}
    for name, plane in planes.items():
        codes = plane.view(torch.uint8).flatten(1)
        old = codes.gather(1, target)
        changes = [credited * (becomes[name] - old) for credited, becomes in effects if name in becomes]
        after[name] = scatter_add(codes, target, reduce(add, changes)).view_as(plane).view(plane.dtype)
    return state.replace(**after)


def is_second(target: Tensor, acting: Tensor) -> Tensor:
    """Return which agents act on a target that an acting agent of lower index has, bool [B, A]."""
    same = (target[:, :, None] == target[:, None, :]) & acting[:, :, None] & acting[:, None, :]
    return same.tril(diagonal=-1).any(dim=-1)
