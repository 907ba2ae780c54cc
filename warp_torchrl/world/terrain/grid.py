"""Grid of a layer: shape, coordinate reference system and place, and comparison of two grids."""

from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.crs import distortion, ground_cells


class Grid(NamedTuple):
    """Shape and place of the cells of a layer.

    Attributes:
        shape: (rows, columns).
        crs: Coordinate reference system, a ``rasterio.crs.CRS``; None where the file has none.
        transform: From (column, row) to coordinates, an ``affine.Affine``; the identity where the file has none.
    """

    shape: tuple[int, int]
    crs: Any
    transform: Any

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return (west, south, east, north) in the CRS."""
        x, y = zip(*self.corners, strict=True)
        return min(x), min(y), max(x), max(y)

    @property
    def corners(self) -> list[tuple[float, float]]:
        """Return the places of the four corners in the CRS: the first row's ends, then the last row's."""
        (rows, columns), (a, b, left, d, e, top) = self.shape, self.transform[:6]
        ends = [(row, column) for row in (0, rows) for column in (0, columns)]
        return [(left + a * column + b * row, top + d * column + e * row) for row, column in ends]

    @property
    def cell_size(self) -> float:
        """Return the side of a cell of a metric grid [m]; 30 where the file has no place on Earth."""
        if not self.is_placed:
            return 30.0
        return self.transform[0] * (self.crs.linear_units_factor[1] if self.crs else 1.0)

    @property
    def distortion(self) -> str:
        """Return in words why the cells of a metric grid differ on the ground from the map; else nothing.

        In Web Mercator, or far from the parallels of a conic projection, a metre of the map is none of the ground.
        """
        if not self.crs or not self.crs.is_projected or not self.is_placed:
            return ""
        return distortion(ground_cells(self.crs, self.transform, self.shape), self.cell_size)

    @property
    def is_metric(self) -> bool:
        """Return whether the cells are squares of 0.1 m to 100 km, north up (a hundredth of a side may be off)."""
        if self.crs and not self.crs.is_projected:
            return False
        side, skew_x, _, skew_y, down, _ = self.transform[:6]
        straight = all(abs(off) <= 0.01 * side for off in (skew_x, skew_y, side + down))
        return not self.is_placed or (straight and 0.1 <= self.cell_size <= 100_000.0)

    @property
    def is_placed(self) -> bool:
        """Return whether the file says where its cells lie."""
        return bool(self.transform != type(self.transform).identity())

    @property
    def is_on_earth(self) -> bool:
        """Return whether the CRS, projected or in degrees, gives the cells a place on Earth."""
        return bool(self.crs) and (self.crs.is_projected or self.crs.is_geographic)

    def differs_in(self, other: "Grid") -> str | None:
        """Return ``shape``, ``crs``, ``bounds`` or ``corners``, the first that differs.

        None where every cell lies on its like: a grid whose first row is its southern one has the bounds alone.
        """
        near = 0.01 * abs(other.transform[0])
        if self.shape != other.shape or self.crs != other.crs:
            return "crs" if self.shape == other.shape else "shape"
        pairs = ((each, getattr(self, each), getattr(other, each)) for each in ("bounds", "corners"))
        return next((each for each, own, wanted in pairs if not np.allclose(own, wanted, rtol=0, atol=near)), None)


def check_grid(name: str, grid: Grid, other: str, reference: Grid) -> None:
    """Refuse a layer whose cells do not lie on those of another, ``other``.

    Raises:
        ValueError: With what differs: the shape, the CRS or the bounds.
    """
    what = grid.differs_in(reference)
    if what is not None:
        wanted, got = getattr(reference, what), getattr(grid, what)
        raise ValueError(f"{name} must have the {what.replace('crs', 'CRS')} of {other}, {wanted}, got {got}")
