"""Windows of a map about a fire: what lies beyond them is neither computed nor kept."""

from dataclasses import dataclass, replace
from math import ceil

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.state.state import Landscape

SIDE = 128
"""Least side of a window [cells]; smaller maps are a window each."""
COLUMNS = 64
"""What the columns of a window are a multiple of, unless it is the whole map. Some of torch's operations (pow, atan2)
round otherwise in a last part that does not fill their vectors, and no cell of a window may lie in one."""
_MARGIN = 8  # about what burns at first [cells]


@dataclass(frozen=True)
class Window:
    """Some rows and columns of a map. The last columns may lie past the map's east side, where nothing burns."""

    top: int
    left: int
    height: int
    width: int
    map: tuple[int, int]  # (rows, columns) of the map

    @classmethod
    def whole(cls, size: tuple[int, int]) -> "Window":
        """Return the window that is the whole map."""
        return cls(0, 0, *size, size)

    @classmethod
    def about(cls, lit: Tensor) -> "Window":
        """Return the first window about the cells that burn at the start, bool [H, W] or [B, H, W], one at least."""
        plane = lit if lit.dim() == 2 else lit.any(0)
        rows, columns = plane.any(1).nonzero()[:, 0], plane.any(0).nonzero()[:, 0]
        north_south, west_east = (
            _widened(int(each[0]) - _MARGIN, int(each[-1]) + 1 + _MARGIN) for each in (rows, columns)
        )
        return cls._between(north_south, west_east, (plane.shape[0], plane.shape[1]))

    @classmethod
    def _between(cls, rows: tuple[int, int], columns: tuple[int, int], size: tuple[int, int]) -> "Window":
        """Return the window from some rows and columns to others, which may lie off the map, without those last."""
        (top, bottom), (left, right) = (
            (max(0, low), min(high, side)) for (low, high), side in zip((rows, columns), size, strict=True)
        )
        if (top, left) == (0, 0) and (bottom, right) == size:
            return cls.whole(size)
        left -= left % COLUMNS
        return cls(top, left, bottom - top, ceil((right - left) / COLUMNS) * COLUMNS, size)

    @property
    def is_whole(self) -> bool:
        """Return whether it is the whole map."""
        return (self.height, self.width) == self.map

    @property
    def cells(self) -> int:
        """Return how many cells it has."""
        return self.height * self.width

    @property
    def on_map(self) -> "Window":
        """Return it without the columns past the map's side."""
        return replace(self, width=min(self.width, self.map[1] - self.left))

    def joined(self, other: "Window") -> "Window":
        """Return the least window that has both."""
        return self._between(
            (min(self.top, other.top), max(self.top + self.height, other.top + other.height)),
            (min(self.left, other.left), max(self.left + self.width, other.left + other.width)),
            self.map,
        )

    def grown(self, north: bool, south: bool, west: bool, east: bool) -> "Window":
        """Return the window twice as long to some sides."""
        return self._between(
            (self.top - north * self.height, self.top + self.height * (1 + south)),
            (self.left - west * self.width, self.left + self.width * (1 + east)),
            self.map,
        )

    def with_cells(self, row: Tensor, column: Tensor) -> "Window":
        """Return this window, or one that has it and some cells of the map, int64 [n], two cells off its sides."""
        (top, bottom), (left, right) = ((int(each.min()), int(each.max()) + 1) for each in (row, column))
        ends = self.top + self.height, self.left + self.width
        if top >= self.top + 2 and left >= self.left + 2 and bottom <= ends[0] - 2 and right <= ends[1] - 2:
            return self
        return self._between(
            (min(self.top, top - _MARGIN), max(ends[0], bottom + _MARGIN)),
            (min(self.left, left - _MARGIN), max(ends[1], right + _MARGIN)),
            self.map,
        )

    def rim(self) -> tuple[Tensor, ...]:
        """Return the outermost cells in the north, south, west and east, bool [h, w] each; none at the map's sides."""
        sides = torch.zeros(4, self.height, self.width, dtype=torch.bool)
        sides[0, 0] = self.top > 0
        sides[1, -1] = self.top + self.height < self.map[0]
        sides[2, :, 0] = self.left > 0
        sides[3, :, -1] = self.left + self.width < self.map[1]
        return sides.unbind(0)

    def cut(self, plane: Tensor, beyond: float | bool) -> Tensor:
        """Return its part of planes [..., H, W]; a value past the map's side."""
        past = self.left + self.width - self.map[1]
        part = plane[..., self.top : self.top + self.height, self.left : self.left + self.width]
        return pad(part, (0, past), value=beyond) if past > 0 else part

    def landscape(self, whole: Landscape) -> Landscape:
        """Return its part of landscapes."""
        leaves = {name: self.around(leaf) if leaf.dim() == 3 else leaf for name, leaf in whole.leaves().items()}
        return whole.with_leaves(leaves)

    def around(self, plane: Tensor, margin: int = 0) -> Tensor:
        """Return its part of planes [..., H, W] with a margin; the map's border is repeated beyond it."""
        rows = torch.arange(self.top - margin, self.top + self.height + margin, device=plane.device)
        columns = torch.arange(self.left - margin, self.left + self.width + margin, device=plane.device)
        part = plane.index_select(-2, rows.clamp(0, self.map[0] - 1))
        return part.index_select(-1, columns.clamp(0, self.map[1] - 1))

    def put(self, values: Tensor, plane: Tensor) -> Tensor:
        """Write values of its cells [..., h, w] into planes of the map [..., H, W], and return those."""
        inside = self.on_map
        part = plane[..., inside.top : inside.top + inside.height, inside.left : inside.left + inside.width]
        part.copy_(values[..., : inside.width])
        return plane

    def place_in(self, other: "Window") -> tuple[slice, slice]:
        """Return its rows and columns in a window that has it."""
        row, column = self.top - other.top, self.left - other.left
        return slice(row, row + self.height), slice(column, column + self.width)

    def index(self) -> Tensor:
        """Return the flat index in the map of each of its cells, int32 [h w]; past the map's side, of another cell."""
        rows = torch.arange(self.top, self.top + self.height, dtype=torch.int32)[:, None]
        columns = torch.arange(self.left, self.left + self.width, dtype=torch.int32).clamp(max=self.map[1] - 1)
        return (rows * self.map[1] + columns).flatten()


def _widened(low: int, high: int) -> tuple[int, int]:
    """Return a side that is as long as a window's must be, about the same middle."""
    more = max(0, SIDE - (high - low))
    return low - more // 2, high + (more - more // 2)
