"""Fronts of law ``rate`` at listed cells of each world, made of the marked ones alone."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.listing import filled, in_all
from warp_torchrl.world.arrays.shortlist import marked_cells
from warp_torchrl.world.law.fronts import Front, front_at
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import WorldState


def fronts(fire: RateFire, state: WorldState, cell: Tensor, is_there: Tensor) -> Front:
    """Return what ``front_at`` does in some cells of each world, float32 [B, n] each.

    Args:
        fire: The automaton.
        state: The worlds.
        cell: Flat indices in each map, int64 [B, n].
        is_there: Which of them are meant, bool [B, n]; the front of others has no meaning.
    """
    place = marked_cells(is_there)
    cells = in_all(cell, state.cells[0].numel()).flatten().index_select(0, place)
    found = front_at(fire, state, pad(cells, (0, filled(len(cells)) - len(cells))))
    none = torch.zeros(cell.numel(), device=cell.device)
    return Front(*(none.index_copy(0, place, each[: len(cells)]).view_as(cell) for each in found))
