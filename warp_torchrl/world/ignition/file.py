"""Ignition from a file: points, lines, a perimeter or a raster."""

import logging
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ignition.ignition import IgnitionSource
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.terrain.cells import read_cells, read_times
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.source import LandscapeSource, map_size

_NAME = "ignition.path"
_SAMPLES = 4  # worlds whose ground is compared
_ENOUGH = 9  # cells, of which one at least bears an old enough tree but once in ten million times
_log = logging.getLogger("warp_torchrl")


def read_ignition(path: str | PathLike[str], grid: Grid) -> np.ndarray:
    """Return the cells that a file lights, bool [rows, columns] of a grid; see ``read_cells`` for the files.

    Whether they can burn is not asked here: see ``on_fuel``.

    Raises:
        ValueError: If the file is missing, damaged or of no such kind, or lights no cell.
    """
    return read_cells(_NAME, path, grid)


def read_ignition_times(path: str | PathLike[str], grid: Grid, moment: Callable[[str], float]) -> np.ndarray | None:
    """Return when a file lights each cell, float32 [rows, columns] [minutes]; None if it has no times: ``read_times``.

    Raises:
        ValueError: See ``read_times``.
    """
    return read_times(_NAME, path, grid, moment)


def on_fuel(lit: np.ndarray, fuel: np.ndarray, path: str | PathLike[str]) -> np.ndarray:
    """Return the cells to light that can burn, bool [rows, columns]; a warning counts the others.

    Raises:
        ValueError: If no cell can burn.
    """
    wet, count = lit & ~fuel, int(lit.sum())
    if not (lit & fuel).any():
        row, column = np.argwhere(lit)[0]
        place = (
            f"row {row}, column {column}" if count == 1 else f"{count} cells, the first at row {row}, column {column}"
        )
        raise ValueError(f"{_NAME} must light ground that can burn, {path} lights {place}, where nothing can")
    if wet.any():
        _log.warning("%s: %d of the %d cells of %s cannot burn and are not lit", _NAME, wet.sum(), count, path)
    return lit & fuel


@dataclass(frozen=True, kw_only=True)
class IgnitionFile(IgnitionSource):
    """Fire in the same cells of every world: the cells that a file marks on the landscape's map, where they can burn.

    Every world must have the same window of the map.

    Attributes:
        path: A CSV of ``row,column`` (of the landscape's map, from 0), ``x,y`` (in its CRS) or
            ``longitude,latitude``; a raster (.tif, .asc) on its grid, not 0 where it burns; GeoJSON or a shapefile of
            points, lines or perimeters, whose inside burns too. None is an error.
        radius: Distance around the file's cells within which cells are lit too (1: a point is a 3 x 3 patch).
        head_start: Fire ticks before the team's first step.

    Raises:
        ValueError: If a value is out of its range or there is no such file.
    """

    path: str | PathLike[str] | None = None
    radius: int = 0
    head_start: int = 0
    _cells: Tensor | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_fields(self, radius=(0, 8), head_start=(0, 1000))
        try:
            exists = self.path is not None and str(self.path) and Path(self.path).is_file()
        except OSError:  # a name too long
            exists = False
        if not exists:
            raise ValueError(f"path must name a file of the cells that burn first, got {self.path}")

    def over(self, landscape: LandscapeSource) -> "IgnitionFile":
        """Return this ignition on the landscape's map.

        Raises:
            ValueError: If worlds get different windows, no cell of theirs is lit or can burn, or so few are that the
                trees there may be too young in some world.
        """
        size, cells = map_size(landscape.size), self._read(landscape)
        corner = getattr(landscape, "corner", (0, 0))
        ground = landscape(world_key(torch.arange(_SAMPLES)))
        if corner is None or (ground.cover != ground.cover[:1]).any():
            raise ValueError(f"{_NAME} must have one ground for all worlds: give landscape.row and landscape.column")
        inside = cells[corner[0] : corner[0] + size[0], corner[1] : corner[1] + size[1]]
        if not inside.any():
            rows, columns = (f"{at}..{at + side - 1}" for at, side in zip(corner, size, strict=True))
            raise ValueError(
                f"{_NAME} must light the world's window, rows {rows}, columns {columns}, {self.path} does not"
            )
        if inside.sum() < cells.sum():
            outside = int(cells.sum() - inside.sum())
            _log.warning("%s: %d of the %d cells of %s lie off the window", _NAME, outside, cells.sum(), self.path)
        lit = grow(torch.from_numpy(np.ascontiguousarray(inside))[None], self.radius)[0]
        kept = torch.from_numpy(on_fuel(lit.numpy(), holds_trees(ground.cover[0]).numpy(), str(self.path)))
        trees = ground.age[:, kept]
        if trees.shape[1] < _ENOUGH and (trees != trees[:1]).any():
            count = trees.shape[1]
            rule = "give landscape.ages=oldest, or a larger ignition.radius"
            raise ValueError(f"{_NAME} must light trees of known age where it lights only {count} cells, {rule}")
        made = copy(self)
        object.__setattr__(made, "_cells", kept)
        return made

    def __call__(self, key: Tensor, fuel: Tensor) -> Tensor:
        """Return the cells to light, bool [B, H, W]: fuel only.

        Raises:
            ValueError: If it is not ``over`` a landscape.
        """
        if self._cells is None:
            raise ValueError("ignition must be over a landscape before it lights fires")
        return self._cells.to(fuel.device) & fuel

    @property
    def why_dark(self) -> str:
        """Return the message for a world without a cell to light."""
        return f"{_NAME} must light a tree that can burn, in some world {self.path} lights none; see landscape.ages"

    def _read(self, landscape: LandscapeSource) -> np.ndarray:
        extent = getattr(landscape, "extent", None) or map_size(landscape.size)
        grid = getattr(landscape, "grid", None) or Grid(extent, None, None)
        return read_ignition(str(self.path), grid)
