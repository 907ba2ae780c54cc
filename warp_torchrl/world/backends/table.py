"""Chances from a table: under one wind and on level ground, a cell's depends on its kind and its burning neighbours.

There are 256 patterns of burning neighbours, so a small table holds every chance that a world's ticks can meet. A
pattern is a byte with a bit for each neighbour, see ``bit_of``.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.bytes import byte
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.backends.join import in_place
from warp_torchrl.world.law.fire import Fire, Gains
from warp_torchrl.world.state.state import WorldState


@dataclass(eq=False, repr=False)
class Tabled(Gains):
    """What the law makes of one wind for each world, and its probabilities on level ground."""

    table: Tensor  # float32 [B,G,256], of ``pattern_table``


def table_in(state: WorldState) -> Tensor | None:
    """Return the table that worlds hold, float32 [B, G, 256]; None where they have slopes or several winds."""
    terms = state.air.terms
    return terms.table if isinstance(terms, Tabled) else None


def pattern_table(fire: Fire, gain: Tensor) -> Tensor:
    """Return the probability to ignite of each kind of ground under each pattern of burning neighbours.

    Args:
        fire: The automaton.
        gain: w_d / distance_d, float32 [B, 8, 1, 1].

    Returns:
        float32 [B, G + 1, 256]; the first kind is of cells that cannot ignite, all 0.
    """
    law = in_place(fire.law)
    strengths = gain[..., 0] * pad(law.susceptibility(numbers(tuple(fire.alpha), gain.device)), (1, 0))
    total = torch.zeros_like(strengths[:, 0, :, None])
    for direction in fire.directions:  # doubles the columns: as they were, and with this neighbour too
        strength = strengths[:, direction, :, None].expand_as(total).clone()
        joined = total.clone()
        law.join(joined, strength, torch.empty_like(total))
        total = torch.cat((total, joined), dim=-1)
    return law.probability(total).index_select(-1, _columns(fire.directions, gain.device))


def probability_by_pattern(table: Tensor, spreading: Tensor, kind: Tensor) -> Tensor:
    """Return what ``rows.probability_from_rows`` does of level worlds with one wind each, to the bit.

    Args:
        table: Of ``pattern_table``, float32 [B, G + 1, 256].
        spreading: The burning cells that ignite others, bool [B, H, W].
        kind: Row of the table, 0 for a cell that cannot ignite, uint8 [B, H, W].

    Returns:
        float32 [B, H, W].
    """
    pattern = burning_neighbours(spreading)
    index = torch.add(pattern.to(torch.int16), kind.to(torch.int16), alpha=_PATTERNS).to(torch.int64)
    return table.flatten(1).gather(1, index.flatten(1)).view(kind.shape)


def burning_neighbours(spreading: Tensor) -> Tensor:
    """Return the pattern of the eight neighbours of each cell that spread fire, uint8 [B, H, W].

    In the order of the bits the three of a row are one sum, which serves the cells north and south of them.
    """
    mask = byte(spreading)
    worlds, _, width = mask.shape
    eastward, westward = mask.clone(), mask.clone()
    eastward[:, :, -1] = 0  # leaves the map
    westward[:, :, 0] = 0
    beside = torch.zeros_like(mask).flatten()
    beside[1:].add_(eastward.flatten()[:-1])
    beside[:-1].add_(westward.flatten()[1:], alpha=2)
    row = torch.add(beside, mask.flatten(), alpha=4).view(worlds, -1)
    around = (beside * 64).view(worlds, -1)
    around[:, width:].add_(row[:, :-width])
    around[:, :-width].add_(row[:, width:], alpha=8)
    return around.view_as(mask)


_TRAVELS = (3, 5, 4, 1, 7, 0, 2, 6)
"""The direction in which fire comes from the neighbour of each bit."""
BESIDE = sum(1 << bit for bit, direction in enumerate(_TRAVELS) if direction % 2 == 0)
"""The bits of the four neighbours that are not diagonal ones."""
_PATTERNS = 256


def bit_of(direction: int) -> int:
    """Return which bit of a pattern tells of the neighbour that fire in a direction comes from, 0..7."""
    return _TRAVELS.index(direction)


@kept(8)
def bits(directions: range, device: torch.device) -> Tensor:
    """Return ``bit_of`` each direction, int64 [D, 1]."""
    return torch.tensor([[bit_of(direction)] for direction in directions], device=device)


@kept(8)
def _columns(directions: range, device: torch.device) -> Tensor:
    """Return which column each pattern has where the directions double the columns in turn, int64 [256]."""
    pattern = torch.arange(_PATTERNS)
    column = torch.zeros_like(pattern)
    for index, direction in enumerate(directions):
        column += ((pattern >> bit_of(direction)) & 1) << index
    return column.to(device)
