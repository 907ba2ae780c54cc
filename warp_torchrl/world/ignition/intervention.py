"""Interventions of people, outside of the rules: lighting a cell, cutting a firebreak, changing the wind.

Each function is pure. It changes the cells that allow it and no others.
"""

import torch
from torch import Tensor

from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState


def can_be_lit(state: WorldState, fire: Automaton) -> Tensor:
    """Return which cells hold a tree that can ignite now: old enough, dry and flammable; bool [B, H, W]."""
    return fire.can_ignite(state)


def ignited(state: WorldState, fire: Automaton, where: Tensor) -> WorldState:
    """Return worlds in which marked cells have caught fire; a world that had ended without fire continues.

    Args:
        state: The worlds.
        fire: Their automaton.
        where: bool [B, H, W]; cells that cannot be lit are not changed.
    """
    lit = where & can_be_lit(state, fire)
    changes = {
        "cells": torch.where(lit, FIRST_FIRE, state.cells),
        "age": torch.where(lit, state.cells, state.age),
        "terminated": state.terminated & ~lit.flatten(1).any(dim=1),
    }
    if state.stage_age is not None:
        changes["stage_age"] = state.stage_age.masked_fill(lit, 0)
    return fire.lit(state.replace(**changes), lit)


def cleared(state: WorldState, where: Tensor) -> WorldState:
    """Return worlds in which trees of marked cells are firebreaks, as a vehicle that clears makes them.

    Args:
        state: The worlds.
        where: bool [B, H, W]; cells without a tree, and burning cells, are not changed.
    """
    cut = where & is_tree(state.cells)
    return state.replace(cells=state.cells.masked_fill(cut, 0), firebreak=state.firebreak | cut)
