"""A role with a new action, a crew that ignites the tree that it stands by: ``team=burners``."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl import register
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.role import Role, add_role
from warp_torchrl.world.state.state import FIRST_FIRE
from warp_torchrl.world.team.abilities import Ability, AgentContext, Effect
from warp_torchrl.world.team.team import Team


@register("ability", "drip_torch")
@dataclass(frozen=True)
class DripTorch(Ability):
    """Ignites the tree of the own cell."""

    actions = ("ignite",)

    def mask(self, now: AgentContext) -> Tensor:
        """Return where there is a dry tree that can burn, bool [B, A, 1]."""
        state, cell = now.state, now.own_cell
        burns = is_tree(now.at(state.cells, cell)) & (now.at(state.alpha, cell) > 0.0) & (now.at(state.wet, cell) == 0)
        return burns[..., None]

    def act(self, now: AgentContext, choice: Tensor) -> Effect:
        """Return what igniting it would do: a tree that burns keeps its age, for when it is put out."""
        age = now.at(now.state.cells, now.own_cell)
        return Effect(self.mask(now)[..., 0], {"cells": FIRST_FIRE, "age": age})


add_role("burner", Role("burner", abilities=("move", "drip_torch")))


@register("team")
@dataclass(frozen=True, kw_only=True)
class Burners(Team):
    """As ``Team``; every other vehicle is a crew with drip torches."""

    roles: tuple[str, ...] = ("ugv", "burner")
