"""The squares of cells about the agents."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.bytes import byte, to_codes, to_int32, to_uint8
from warp_torchrl.world.arrays.compile import is_fused, opaque_op


@dataclass(frozen=True, eq=False)
class Window:
    """The squares of cells about the agents."""

    position: Tensor
    """(row, column) of the agents, int64 [B, A, 2] [cells]."""
    radius: int
    """r [cells]; V = 2 r + 1."""
    index: Tensor
    """Flat index of each cell, moved to the border where it is off the map, int64 [B, A V V]."""
    inside: Tensor
    """1 on the map and 0 beyond, uint8 [B, A, V, V]."""

    def of(self, plane: Tensor) -> Tensor:
        """Return what a plane [B, H, W] of numbers shows, [B, A, V, V]; 0 beyond the map."""
        return plane.flatten(1).gather(1, self.index).view_as(self.inside).mul_(self.inside)

    def of_own(self, planes: Tensor) -> Tensor:
        """Return what each agent's own plane [B, A, H, W] of numbers shows, [B, A, V, V]; 0 beyond the map."""
        index = self.index.view(*self.position.shape[:2], -1)
        return planes.flatten(2).gather(2, index).view_as(self.inside).mul_(self.inside)

    def bytes_of(self, codes: Sequence[Tensor], fractions: Sequence[Sequence[Tensor]]) -> list[Tensor]:
        """Return what planes show, in bytes 0..255, uint8 or ``to_int32``, [B, A, V, V] each; 0 beyond the map.

        Compiled, four planes at most are read at once, as the bytes of a word.

        Args:
            codes: Planes [B, H, W] of codes 0..255, uint8 or ``to_int32``.
            fractions: Planes [B, H, W] of numbers whose sum is in 0..1, float32; the sum is shown times 255.
        """
        if not is_fused():
            sums = [reduce(Tensor.add_, [self.of(part) for part in parts]) for parts in fractions]
            return [self.of(plane) for plane in codes] + [_share(each) for each in sums]
        planes = [*codes, *(_share(reduce(torch.add, parts)) for parts in fractions)]
        word = reduce(operator.or_, (to_int32(plane) << 8 * place for place, plane in enumerate(planes)))
        shown = _squares(word, self.position, self.radius)
        return [(shown >> 8 * place) & 255 for place in range(len(planes))]


def window(position: Tensor, size: Sequence[int], radius: int) -> Window:
    """Return the squares about the agents.

    Args:
        position: int64 [B, A, 2] [cells].
        size: (H, W) of the map [cells].
        radius: r [cells]; V = 2 r + 1.
    """
    _, width = size
    lines = position[..., None] + _away(radius, position.device)  # the square's rows, then its columns
    on_map, is_on_map = clamped(lines, size)
    row, column = on_map.unbind(-2)
    has_row, has_column = byte(is_on_map).unbind(-2)
    index = torch.add(column[..., None, :], row[..., None], alpha=width)
    return Window(position, radius, index.flatten(1), to_uint8(has_row[..., None] * has_column[..., None, :]))


def clamped(lines: Tensor, size: Sequence[int]) -> tuple[Tensor, Tensor]:
    """Return rows and columns moved to the edge of a map of (H, W) where they are beyond it, and which are not, bool.

    Args:
        lines: The rows, then the columns, int64 [..., 2, n].
        size: (H, W).
    """
    on_map = torch.clamp(lines, *_bounds(*size, lines.device))
    return on_map, on_map == lines


@kept(32)
def _away(radius: int, device: torch.device) -> Tensor:
    return torch.arange(-radius, radius + 1, device=device)


@kept(32)
def _bounds(height: int, width: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """Return the least and the largest (row, column) of a map, int64 [2, 1] each."""
    last = torch.tensor([[height - 1], [width - 1]], device=device)
    return torch.zeros_like(last), last


def _square(plane: Tensor, position: Tensor, radius: int) -> Tensor:
    return plane.new_empty(*position.shape[:2], 2 * radius + 1, 2 * radius + 1)


# A compiler would look up cell after cell, and ask of each whether it is on the map.
@opaque_op("(Tensor plane, Tensor position, int radius) -> Tensor", like=_square)
def _squares(plane: Tensor, position: Tensor, radius: int) -> Tensor:
    return window(position, plane.shape[1:], radius).of(plane)


def stacked(channels: Sequence[Tensor]) -> Tensor:
    """Return channels [B, A, V, V] of whole numbers 0..255 as one tensor, uint8 [B, A, C, V, V]."""
    codes = [to_uint8(channel) for channel in channels]
    return _stacked([each.contiguous() for each in codes] if is_fused() else codes)


# A compiler would write squares of odd sides a few cells at a time.
@opaque_op("(Tensor[] channels) -> Tensor")
def _stacked(channels: list[Tensor]) -> Tensor:
    return torch.stack(channels, dim=2)


def _share(fractions: Tensor) -> Tensor:
    """Return 255 times numbers in 0..1, cut to whole ones, uint8 or ``to_int32``."""
    return to_codes(fractions * 255.0)
