"""How fire passes from burning cells to their neighbours: the two laws, and the sum over directions.

Each burning neighbour acts on a tree with a strength f = susceptibility w_d s_d / distance_d; a law makes chances of
strengths.
"""

from typing import Protocol

import torch
from torch import Tensor
from torch.compiler import is_compiling
from torch.nn.functional import pad

from warp_torchrl.world.flags import number
from warp_torchrl.world.fusion import fusible
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

    def of(self, strength: Tensor) -> Tensor:
        """Return the chance of one strength."""
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

    def of(self, strength: Tensor) -> Tensor:
        """Return clip(f, 0, 1)."""
        return strength.clamp(max=1.0)

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

    def of(self, strength: Tensor) -> Tensor:
        """Return 1 - exp(-f)."""
        return -torch.expm1(-strength)

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
        slope: The slope's factor into the target, float32 [B, 8, H + 2, W + 1], see ``kernel.slope_factor``; None where
            the world is flat.
        neighbours: 8, or 4 without the diagonal ones.
        diagonal: ``distance`` divides by the distance to the neighbour, ``unit`` treats all alike.
        expected: Whether to sum each neighbour's chance at its source as well.

    Returns:
        Chance float32 [B, H, W]; and the number of neighbours that each burning cell is expected to ignite, float32
        [B, H, W], or None.
    """
    margin = susceptible.shape[2] + 2
    burning = number(spreading)
    rows = [_in_a_row(burning, margin)]
    if wind.shape[2:] != (1, 1):
        rows = [_in_a_row(burning * wind[:, direction], margin) for direction in range(8)]
        wind = torch.ones_like(wind[..., :1, :1])
    target = _in_a_row(susceptible, margin)
    return _sum_over_directions(
        law, rows, target, wind[:, :, :, 0], slope, tuple(susceptible.shape), neighbours, diagonal, expected
    )


@fusible
def _sum_over_directions(
    law: Law,
    rows: list[Tensor],
    susceptible: Tensor,
    wind: Tensor,
    slope: Tensor | None,
    shape: tuple[int, int, int],
    neighbours: int,
    diagonal: str,
    expected: bool,
) -> tuple[Tensor, Tensor | None]:
    """Return what ``ignition_chance`` does, of maps that lie in a row.

    Args:
        law: As there.
        rows: The burning cells in a row, times the wind's factor where it differs by cell: one, or one a direction.
        susceptible: In a row.
        wind: The factor that is the same in all of a world, float32 [B, 8, 1].
        slope: As there.
        shape: (B, H, W).
        neighbours: As there.
        diagonal: As there.
        expected: As there.
    """
    worlds, height, width = shape
    margin, size = width + 2, worlds * (height + 1) * (width + 1)
    middle = slice(margin, margin + size)
    target = susceptible[middle].view(worlds, -1)
    total, strength, spare = torch.zeros_like(target), torch.empty_like(target), torch.empty_like(target)

    def slope_from(direction: int, shift: int) -> Tensor:
        """Return the slope's factor of each cell, shifted by so many cells, [B, n]."""
        first = (direction * (height + 2) + 1) * (width + 1) + shift
        return slope.flatten(1)[:, first : first + target.shape[1]]

    # Sums into shifted places do not fuse: fused, each source gathers the same terms in the same order.
    sum_at_source = torch.zeros_like(susceptible) if expected and not is_compiling() else None
    gathered = torch.zeros_like(target) if expected and is_compiling() else None
    for direction in range(0, 8, 8 // neighbours):
        row, column = DIRECTIONS[direction]
        gain = wind[:, direction] * (1.0 if diagonal == "unit" else 1.0 / DISTANCES[direction])
        source = rows[direction % len(rows)]
        start = margin - row * (width + 1) - column
        here = slice(start, start + size)
        torch.mul(source[here].view_as(target), gain, out=strength)
        strength.mul_(target)
        if slope is not None:
            strength *= slope_from(direction, 0)
        at_source = None if sum_at_source is None else sum_at_source[here].view_as(target)
        law.join(total, strength, spare, at_source)
        if gathered is not None:
            there = slice(2 * margin - start, 2 * margin - start + size)
            passed = source[middle].view_as(target) * gain * susceptible[there].view_as(target)
            if slope is not None:
                passed = passed * slope_from(direction, margin - start)
            gathered = gathered + law.of(passed)

    def on_map(row_of_maps: Tensor) -> Tensor:
        return row_of_maps.view(worlds, height + 1, width + 1)[:, :height, :width].contiguous()

    if expected:
        return on_map(law.chance(total)), on_map(sum_at_source[middle] if gathered is None else gathered)
    return on_map(law.chance(total)), None


def _in_a_row(maps: Tensor, margin: int) -> Tensor:
    """Lay [B, H, W] maps out in one row, each with a zero column and row after it and a margin at both ends."""
    return pad(pad(maps, (0, 1, 0, 1)).flatten(), (margin, margin))
