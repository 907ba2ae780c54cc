"""Windows of a map that is larger than the world: the windows that qualify, and the one of each world."""

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.state.state import Cover, Landscape
from warp_torchrl.world.terrain.landscape import draw_age
from warp_torchrl.world.terrain.source import map_size

DRAWN = 255
"""Age code of a cell whose age is drawn for each episode."""
CROWN_LAYERS = ("canopy_base_height", "canopy_bulk_density")
"""Layers by which a fire runs in crowns, beside canopy cover and height."""
_LOWEST = -32768  # fuel code
_LAYERS = ("cover", "age", "elevation", "assets", "fuel", "canopy_cover", "canopy_height", *CROWN_LAYERS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Crop:
    """Draws a window of one map for each world, evenly among those without unknown cells and with enough fuel.

    Attributes:
        cover: Land cover, uint8 [rows, columns], ``Cover`` codes.
        elevation: Elevation [m], float32 [rows, columns]; None makes flat worlds.
        age: Tree age, uint8 [rows, columns], 0..10, or ``DRAWN``; None draws it everywhere.
        assets: Worth of each cell, float32 [rows, columns]; None leaves all alike.
        fuel: Class codes of the fuel layer, int16 [rows, columns]; None where there is none.
        canopy_cover: Canopy cover [%], float32 [rows, columns]; None if not known.
        canopy_height: Height of the canopy's top [m], float32 [rows, columns]; None if not known.
        canopy_base_height: Height of the crowns' base [m], float32 [rows, columns]; None if not known.
        canopy_bulk_density: What burns in crowns [kg/m3], float32 [rows, columns]; None if not known.
        known: Where the map is known, bool [rows, columns]; None is everywhere.
        size: Side of a window, or (rows, columns) [cells].
        row: Top row of the only window; None, with ``column``, leaves it to the draw.
        column: Left column of the only window.
        min_fuel: Lowest share of a drawn window where trees can stand; one cell at least is always required.

    Raises:
        ValueError: If no window qualifies, or ``row`` and ``column`` name none without unknown cells.
    """

    cover: np.ndarray = field(repr=False)
    elevation: np.ndarray | None = field(default=None, repr=False)
    age: np.ndarray | None = field(default=None, repr=False)
    assets: np.ndarray | None = field(default=None, repr=False)
    fuel: np.ndarray | None = field(default=None, repr=False)
    canopy_cover: np.ndarray | None = field(default=None, repr=False)
    canopy_height: np.ndarray | None = field(default=None, repr=False)
    canopy_base_height: np.ndarray | None = field(default=None, repr=False)
    canopy_bulk_density: np.ndarray | None = field(default=None, repr=False)
    known: np.ndarray | None = field(default=None, repr=False)
    size: tuple[int, int] | int
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    _draws_age: bool = field(init=False, repr=False)
    _maps: dict[torch.device, tuple[Tensor, dict[str, Tensor]]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        corners = self._find_corners()
        ground = slice(None), slice(None)
        if len(corners) == 1:  # the only window, so every world gets the same ground: cut it out once
            (row, column), (height, width) = divmod(int(corners), self.cover.shape[1]), map_size(self.size)
            ground = slice(row, row + height), slice(column, column + width)
        layers = {name: getattr(self, name) for name in _LAYERS if getattr(self, name) is not None}
        maps = {name: torch.from_numpy(np.ascontiguousarray(layer[ground])) for name, layer in layers.items()}
        object.__setattr__(self, "_draws_age", self.age is None or bool((self.age == DRAWN).any()))
        object.__setattr__(self, "_maps", {torch.device("cpu"): (corners, maps)})

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world's window, with its ``corner`` in the map, batch size [B].

        Args:
            key: World keys, int64 [B].
        """
        if key.device not in self._maps:
            corners, maps = self._maps[torch.device("cpu")]
            there = {name: layer.to(key.device) for name, layer in maps.items()}
            self._maps[key.device] = corners.to(key.device), there
        corners, maps = self._maps[key.device]
        draw = uniform(key, 0, Stream.CROP, (1, 1))[:, 0, 0].double()  # float32 cannot count past 2^24 windows
        window, across = corners[(draw * len(corners)).long()], self.cover.shape[1]
        corner = torch.stack((window // across, window % across), dim=1)
        planes = {name: self._cut(layer, corner) for name, layer in maps.items()}
        cover, elevation = planes.pop("cover"), planes.pop("elevation", None)
        age = self._fill_age(key, cover, planes.pop("age", None))
        return Landscape(cover, age, elevation, corner).with_layers(**planes)

    @property
    def corner(self) -> tuple[int, int] | None:
        """Return (row, column) of the window that every world has; None where it is drawn."""
        corners = self._maps[torch.device("cpu")][0]
        row, column = divmod(int(corners[0]), self.cover.shape[1])
        return (row, column) if len(corners) == 1 else None

    @property
    def extent(self) -> tuple[int, int]:
        """Return (rows, columns) of the map."""
        return self.cover.shape

    def reach(self) -> np.ndarray:
        """Return the cells that some window has, bool [rows, columns]."""
        height, width = map_size(self.size)
        corners = self._maps[torch.device("cpu")][0].numpy()
        first = np.zeros(self.cover.shape, bool)
        if len(corners) == 1:
            row, column = divmod(int(corners[0]), self.cover.shape[1])
            first[row : row + height, column : column + width] = True
            return first
        first.flat[corners] = True
        padded = torch.from_numpy(np.pad(first, ((height - 1, 0), (width - 1, 0))))
        return (_sum_windows(padded, height, width) > 0).numpy()

    def _cut(self, layer: Tensor, corner: Tensor) -> Tensor:
        """Return each world's window of a layer, [B, H, W]."""
        height, width = map_size(self.size)
        if layer.shape == (height, width):
            return layer.repeat(len(corner), 1, 1)
        row = corner[:, 0, None, None] + torch.arange(height, device=layer.device)[:, None]
        column = corner[:, 1, None, None] + torch.arange(width, device=layer.device)
        return layer[row, column]

    def _fill_age(self, key: Tensor, cover: Tensor, age: Tensor | None) -> Tensor:
        """Return the age of each cell, drawn where the map has none; 0 where no tree can stand."""
        if age is not None and not self._draws_age:
            return age * holds_trees(cover)
        drawn = draw_age(key, cover)
        return drawn if age is None else torch.where(age == DRAWN, drawn, age * holds_trees(cover))

    def _find_corners(self) -> Tensor:
        """Return the flat index of the top left cell of each window to draw from, int64 [windows]."""
        height, width = map_size(self.size)
        rows, columns = self.cover.shape
        if height > rows or width > columns:
            raise ValueError(f"size must fit in the map of {rows} x {columns} cells, got {height} x {width}")
        known = np.ones(self.cover.shape, bool) if self.known is None else self.known
        if self.row is not None or self.column is not None:
            row, column = self._fixed_corner(known)
            return torch.tensor([row * columns + column])
        whole = _sum_windows(torch.from_numpy(~known), height, width) == 0
        least = max(1, math.ceil(self.min_fuel * height * width - 1e-6))
        fuel = _sum_windows(holds_trees(torch.from_numpy(self.cover)), height, width)
        window = (whole & (fuel >= least)).flatten().nonzero().squeeze(1)
        if not len(window):
            rule = f"window of {height} x {width} cells without nodata and with min_fuel {self.min_fuel:g}"
            raise ValueError(f"size must leave some place, the map has no {rule}{whereabouts(~known)}")
        across = whole.shape[1]
        return window // across * columns + window % across

    def _fixed_corner(self, known: np.ndarray) -> tuple[int, int]:
        """Return ``row`` and ``column`` if they name a window without nodata."""
        corner, (height, width) = [], map_size(self.size)
        for name, side, length in zip(("row", "column"), known.shape, (height, width), strict=True):
            value, count = getattr(self, name), side - length + 1
            if type(value) is not int or not 0 <= value < count:
                raise ValueError(f"{name} must be whole, in 0..{count - 1} for a window in the map, got {value}")
            corner.append(value)
        row, column = corner
        if not known[row : row + height, column : column + width].all():
            inside = np.zeros_like(known)
            inside[row : row + height, column : column + width] = True
            lies = whereabouts(~known, inside)
            raise ValueError(f"row, column must name a window without nodata, got {row}, {column}{lies}")
        return row, column


@dataclass(frozen=True, kw_only=True)
class Cropped:
    """A landscape whose worlds are windows of one map; the component that reads the map makes the ``Crop``."""

    _crop: Crop = field(init=False, repr=False, compare=False)

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world's window, with its ``corner`` in the map, batch size [B]."""
        return self._crop(key)

    @property
    def is_flat(self) -> bool:
        """Return whether there is no elevation."""
        return self._crop.elevation is None

    @property
    def extent(self) -> tuple[int, int]:
        """Return (rows, columns) of the whole map."""
        return self._crop.extent

    @property
    def corner(self) -> tuple[int, int] | None:
        """Return (row, column) of the window that every world has; None where it is drawn."""
        return self._crop.corner

    def reach(self) -> np.ndarray:
        """Return where a world may lie, bool [rows, columns]."""
        return self._crop.reach()

    def fuel_codes(self) -> dict[tuple[int, int], int]:
        """Return how many cells each pair of a fuel code and a cover has where trees can stand and a world may lie."""
        fuel, cells = self._crop.fuel, dict[tuple[int, int], int]()
        if fuel is None:
            return {}
        reach, covers = self.reach(), torch.arange(len(Cover), dtype=torch.uint8)
        for cover in covers[holds_trees(covers)].tolist():
            counts = np.bincount(fuel[(self._crop.cover == cover) & reach].astype(np.int32) - _LOWEST)
            cells |= {(int(place) + _LOWEST, cover): int(counts[place]) for place in counts.nonzero()[0]}
        return cells


def check_crowns(given: tuple[str, ...], needed: tuple[str, str]) -> None:
    """Refuse a map with some of the layers by which crowns burn, and not all.

    Args:
        given: Names of the layers of the map.
        needed: Names of canopy cover and height.

    Raises:
        ValueError: With the layers that are missing.
    """
    there = [name for name in CROWN_LAYERS if name in given]
    missing = [name for name in (*needed, *CROWN_LAYERS) if name not in given]
    if there and missing:
        raise ValueError(f"{there[0]} must be given with {' and '.join(missing)}, by which crowns burn, got none")


def whereabouts(unknown: np.ndarray, inside: np.ndarray | None = None) -> str:
    """Return in words where cells are not known, bool [rows, columns], of those inside; empty if all are."""
    lies = unknown if inside is None else unknown & inside
    if not lies.any():
        return ""
    rows, columns = np.flatnonzero(lies.any(1)), np.flatnonzero(lies.any(0))
    share = lies.sum() / (lies.size if inside is None else inside.sum())
    place = f"in rows {rows[0]}..{rows[-1]}, columns {columns[0]}..{columns[-1]}"
    return f"; nodata lies {place} ({lies.sum()} cells, {100 * share:.3g} %); nodata=unburnable makes it no fuel"


def _sum_windows(mask: Tensor, height: int, width: int) -> Tensor:
    """Count the set cells of each window by its top left cell, from a summed-area table, int32 [.., ..]."""
    total = torch.zeros(mask.shape[0] + 1, mask.shape[1] + 1, dtype=torch.int32)
    total[1:, 1:] = mask.cumsum(0, dtype=torch.int32).cumsum(1, dtype=torch.int32)
    return total[height:, width:] - total[:-height, width:] - total[height:, :-width] + total[:-height, :-width]
