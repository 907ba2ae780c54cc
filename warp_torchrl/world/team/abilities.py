"""Abilities: what vehicles can do. A role is a list of them, and the actions of a team follow from its roles'.

A module of a user's own adds an ability to the table, and a role that has it (``role.add_role``):

    @ability("drip_torch")
    class DripTorch(Ability):
        actions = ("ignite",)
        ...
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.validation import check_new_name
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.arrays.squares import clamped
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.role import RoleTable
from warp_torchrl.world.state.state import FIRST_FIRE, Cover, WorldState

_NEIGHBOURHOOD = ((0, 0), (-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, eq=False)
class AgentContext:
    """What an ability reads: the worlds and the rules of team and fire."""

    state: WorldState
    roles: RoleTable
    extinguish_p: float  # chance that putting a fire out succeeds
    last_spreading: int  # cell code of the last stage that can be put out
    wet_ticks: int = 0  # for which a tree that was put out stays wet; 0 where a mask is asked for

    @property
    def own_cell(self) -> Tensor:
        """Return the flat index of each agent's cell, row * W + column, int64 [B, A]."""
        return own_cell(self.state)

    @staticmethod
    def at(plane: Tensor, index: Tensor) -> Tensor:
        """Return what a plane [B, H, W] holds at flat indices int64 [B, A], [B, A]."""
        return plane.flatten(1).gather(1, index)


class Effect(NamedTuple):
    """What an action would do if each agent chose it."""

    possible: Tensor  # bool [B, A], whether it would do anything
    becomes: Mapping[str, Tensor | int] = {}
    """What planes of the state (uint8 or bool, by name) hold at the target afterwards, uint8 [B, A] or one number."""
    target: Tensor | None = None  # flat index of the cell that it changes, int64 [B, A]; None: the agent's own
    step: Tensor | None = None  # by how much the agent moves, int64 [B, A, 2] [cells]
    takes_water: Tensor | None = None  # bool [B, A], whether it empties a tank by one


@dataclass(frozen=True)
class Ability:
    """What a kind of vehicle can do; it holds no state.

    Attributes:
        actions: Names of its actions, in order.
        moves: Whether it moves the vehicle. All agents move before any agent does anything else.
    """

    actions: ClassVar[tuple[str, ...]] = ()
    moves: ClassVar[bool] = False

    def mask(self, now: AgentContext) -> Tensor:
        """Return which of its actions would do something, bool [B, A, actions], as if every agent had it."""
        raise TypeError(f"{type(self).__name__} does not say what is possible: define mask()")

    def act(self, now: AgentContext, choice: Tensor) -> Effect:
        """Return what its actions would do, for each agent's choice of them, int64 [B, A].

        Of an ability with one action the choice means nothing.
        """
        raise TypeError(f"{type(self).__name__} does not say what is done: define act()")


ABILITIES: dict[str, Ability] = {}
"""All abilities by name."""


def ability(name: str) -> Callable[[type[Ability]], type[Ability]]:
    """Return what adds an ability to the table under a name.

    Raises:
        ValueError: If the table has another ability of that name, or one of its actions has another's name.
    """

    def add(kind: type[Ability]) -> type[Ability]:
        check_new_name("ability", name, kind, ABILITIES.get(name))
        others = [each for each in ABILITIES.values() if each.__module__ != kind.__module__]
        taken = {"stay"}.union(*(each.actions for each in others))
        if not kind.actions or taken & set(kind.actions):
            raise ValueError(f"{name} must be an ability with new actions, got {', '.join(kind.actions) or 'none'}")
        ABILITIES[name] = kind()
        return kind

    return add


@ability("move")
class Move(Ability):
    """Moves by the vehicle's stride: ground vehicles enter neither lake nor fire, aircraft fly over anything."""

    actions = ("north", "north_east", "east", "south_east", "south", "south_west", "west", "north_west")
    moves = True

    def mask(self, now: AgentContext) -> Tensor:
        """Return which of the eight moves each agent can make, bool [B, A, 8]; nobody leaves the map."""
        state, roles = now.state, now.roles
        index, inside = places(state, roles.moves)
        flat = index.flatten(1)
        ground, cells = now.at(state.cover, flat), now.at(state.cells, flat)
        blocked = ((ground == int(Cover.LAKE)) | is_burning(cells)).view_as(inside)
        return inside & (~blocked | roles.flies[:, None])

    def act(self, now: AgentContext, choice: Tensor) -> Effect:
        """Return the moves."""
        step = offsets(choice.device)[choice] * now.roles.stride[:, None]
        return Effect(self.mask(now).gather(-1, choice[..., None])[..., 0], step=step)


@ability("extinguish")
class Extinguish(Ability):
    """Puts out the youngest fire of the 3 x 3 neighbourhood: the tree is its old age again, and wet."""

    actions = ("extinguish",)

    def mask(self, now: AgentContext) -> Tensor:
        """Return where there is such a fire, and water, bool [B, A, 1]."""
        _, has_fire = self.nearby_fire(now)
        return (has_fire & (now.state.vehicles.tank != 0))[..., None]

    def act(self, now: AgentContext, choice: Tensor) -> Effect:
        """Return what putting it out would do; it takes water even where it fails."""
        state = now.state
        fire, has_fire = self.nearby_fire(now)
        possible = has_fire & (state.vehicles.tank != 0)
        if now.extinguish_p < 1.0:
            possible &= uniform(state.key, state.step, Stream.ACTION, tuple(fire.shape[1:])) < now.extinguish_p
        becomes: dict[str, Tensor | int] = {
            "cells": now.at(state.age, fire),
            "age": 0,
            "extinguished": 1,
            "wet": now.wet_ticks,
        }
        return Effect(possible, becomes, fire, takes_water=has_fire)

    @staticmethod
    def nearby_fire(now: AgentContext) -> tuple[Tensor, Tensor]:
        """Return the fire that each agent would put out, see ``youngest_fire``."""
        return youngest_fire(now.state, now.last_spreading)


@ability("clear")
class Clear(Ability):
    """Turns the tree of the own cell into a firebreak."""

    actions = ("clear",)

    def mask(self, now: AgentContext) -> Tensor:
        """Return where there is a tree that does not burn, bool [B, A, 1]."""
        return is_tree(now.at(now.state.cells, now.own_cell))[..., None]

    def act(self, now: AgentContext, choice: Tensor) -> Effect:
        """Return what clearing it would do."""
        return Effect(self.mask(now)[..., 0], {"cells": 0, "firebreak": 1})


PAPER_ABILITIES = tuple(ABILITIES)
"""Those of WARP-CA, whose ten actions every team has: a vehicle whose role lacks one is shown it as closed."""


def youngest_fire(state: WorldState, last_spreading: int) -> tuple[Tensor, Tensor]:
    """Return the youngest fire of each agent's 3 x 3 neighbourhood.

    Ties go to the agent's own cell, then in row-major order.

    Args:
        state: The worlds.
        last_spreading: Cell code of the last stage that can be put out.

    Returns:
        Flat index of the cell, int64 [B, A], and whether there is one that can be put out, bool [B, A].
    """
    index, inside = neighbourhood(state)
    codes = AgentContext.at(state.cells, index.flatten(1)).view_as(index).to(torch.int64)
    fits = inside & (codes >= FIRST_FIRE) & (codes <= last_spreading)
    best = torch.where(fits, codes * 16 + _order(codes.device), 1 << 20).argmin(dim=-1, keepdim=True)
    return index.gather(-1, best)[..., 0], fits.any(dim=-1)


def own_cell(state: WorldState) -> Tensor:
    """Return the flat index of each agent's cell, row * W + column, int64 [B, A]."""
    row, column = state.vehicles.position.unbind(-1)
    return torch.add(column, row, alpha=state.cells.shape[2])


def neighbourhood(state: WorldState) -> tuple[Tensor, Tensor]:
    """Return the 3 x 3 cells about each agent, its own first, then in row-major order; as ``places``, n = 9."""
    return places(state, _around(state.cells.device))


def places(state: WorldState, away: Tensor) -> tuple[Tensor, Tensor]:
    """Return where places about the agents are, row * W + column, and which of them are on the map.

    Those off the map are moved to its edge.

    Args:
        state: The worlds.
        away: (rows, columns) from an agent to each, int64 [2, n] or [A, 2, n] [cells].

    Returns:
        int64 [B, A, n] and bool [B, A, n].
    """
    size = state.cells.shape[1:]
    on_map, is_on_map = clamped(state.vehicles.position[..., None] + away, size)
    (row, column), (has_row, has_column) = on_map.unbind(-2), is_on_map.unbind(-2)
    return torch.add(column, row, alpha=size[1]), has_row & has_column


@kept(8)
def _order(device: torch.device) -> Tensor:
    return torch.arange(len(_NEIGHBOURHOOD), device=device)


@kept(8)
def _around(device: torch.device) -> Tensor:
    return torch.tensor(tuple(zip(*_NEIGHBOURHOOD)), device=device)
