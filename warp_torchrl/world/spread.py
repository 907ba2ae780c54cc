"""How fire passes from burning cells to their neighbours: the two laws, and the sum over directions.

Each burning neighbour acts on a tree with a strength f = susceptibility w_d s_d / distance_d; a law makes chances of
strengths.
"""

from typing import Protocol

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.flags import number
from warp_torchrl.world.geometry import DIRECTIONS, DISTANCES

LARGEST_ALPHA = 0.95
"""Flammability from which law ``hazard`` grows no more: at 1 its hazard would have no bound."""


class Law(Protocol):
    """What makes chances of strengths; the planes are float32 of one shape."""

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return the ground's part of a strength."""
        ...

    def join(self, total: Tensor, strength: Tensor, spare: Tensor, at_source: Tensor | None) -> None:
        """Add a direction's strength to the total, and its chance to ``at_source``; the strength is used up."""
        ...

    def chance(self, total: Tensor) -> Tensor:
        """Return the chance to ignite of a total over the directions."""
        ...


class Clipped:
    """Law ``paper``: p_d = clip(f, 0, 1), and q = 1 - prod (1 - p_d) (WARP-CA, spread).

    q is accumulated as q + p_d (1 - q), which keeps 0, 1 and small numbers exact.
    """

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return alpha itself."""
        return alpha

    def join(self, total: Tensor, strength: Tensor, spare: Tensor, at_source: Tensor | None) -> None:
        """Add q + p (1 - q), and p at the source."""
        chance = strength.clamp_(max=1.0)
        if at_source is not None:
            at_source += chance
        total.sub_(torch.sub(total, 1.0, out=spare).mul_(chance))

    def chance(self, total: Tensor) -> Tensor:
        """Return the total, which is the chance."""
        return total


class Hazard:
    """Law ``hazard``: p_d = 1 - exp(-f), and q = 1 - exp(-sum f).

        f = h_d = -ln(1 - min(alpha, 0.95)) / k w_d s_d / dist_d

    After the k ticks of one of the paper's, and all the F stages, a neighbour has been lit with 1 - (1 - alpha)^F.

    Args:
        refinement: k, ticks to one of the paper's.
    """

    def __init__(self, refinement: int) -> None:
        self._scale = -1.0 / refinement

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return -ln(1 - min(alpha, 0.95)) / k."""
        return alpha.clamp(max=LARGEST_ALPHA).neg_().log1p_().mul_(self._scale)

    def join(self, total: Tensor, strength: Tensor, spare: Tensor, at_source: Tensor | None) -> None:
        """Add f, and 1 - exp(-f) at the source."""
        total += strength
        if at_source is not None:
            at_source -= torch.neg(strength, out=spare).expm1_()

    def chance(self, total: Tensor) -> Tensor:
        """Return 1 - exp(-sum f)."""
        return total.neg_().expm1_().neg_()


def ignition_chance(
    law: Law,
    spreading: Tensor,
    susceptible: Tensor,
    wind: Tensor,
    slope: Tensor | None,
    *,
    neighbours: int = 8,
    diagonal: str = "distance",
    expected: bool = False,
) -> tuple[Tensor, Tensor | None]:
    """Return each cell's chance to be ignited by its neighbours in one tick.

    The maps lie in one row with a margin column and row after each, so that all neighbours are contiguous slices at
    constant offsets.

    Args:
        law: What makes chances of strengths.
        spreading: The burning cells that ignite others, bool [B, H, W].
        susceptible: The ground's part of a strength, 0 where nothing can ignite, float32 [B, H, W].
        wind: The wind's factor at the source, float32 [B, 8, 1, 1] or [B, 8, H, W].
        slope: The slope's factor into the target, float32 [B, 8, H + 1, W + 1]; None where the world is flat.
        neighbours: 8, or 4 without the diagonal ones.
        diagonal: ``distance`` divides by the distance to the neighbour, ``unit`` treats all alike.
        expected: Whether to sum each neighbour's chance at its source as well.

    Returns:
        Chance float32 [B, H, W]; and the number of neighbours that each burning cell is expected to ignite, float32
        [B, H, W], or None.
    """
    worlds, height, width = susceptible.shape
    margin = width + 2
    size = worlds * (height + 1) * (width + 1)
    burning = number(spreading)
    source = _in_a_row(burning, margin)
    target = pad(susceptible, (0, 1, 0, 1)).view(worlds, -1)
    total, strength, spare = torch.zeros_like(target), torch.empty_like(target), torch.empty_like(target)
    sum_at_source = torch.zeros_like(source) if expected else None
    for direction in range(0, 8, 8 // neighbours):
        row, column = DIRECTIONS[direction]
        gain = 1.0 if diagonal == "unit" else 1.0 / DISTANCES[direction]
        start = margin - row * (width + 1) - column
        here = slice(start, start + size)
        if wind.shape[2:] == (1, 1):
            torch.mul(source[here].view_as(target), wind[:, direction, :, 0] * gain, out=strength)
        else:
            strength = _in_a_row(burning * wind[:, direction] * gain, margin)[here].view_as(target)
        strength.mul_(target)
        if slope is not None:
            strength *= slope[:, direction].reshape(worlds, -1)
        at_source = None if sum_at_source is None else sum_at_source[here].view_as(target)
        law.join(total, strength, spare, at_source)

    def on_map(row_of_maps: Tensor) -> Tensor:
        return row_of_maps.view(worlds, height + 1, width + 1)[:, :height, :width].contiguous()

    chance = on_map(law.chance(total))
    return chance, None if sum_at_source is None else on_map(sum_at_source[margin : margin + size])


def _in_a_row(maps: Tensor, margin: int) -> Tensor:
    """Lay [B, H, W] maps out in one row, each with a zero column and row after it and a margin at both ends."""
    return pad(pad(maps, (0, 1, 0, 1)).flatten(), (margin, margin))
