"""Landscapes from rasters: a fuel layer and an elevation, GeoTIFF or ESRI ASCII grid, cropped to the world's size."""

import math
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.world.landscape import draw_age, holds_trees, map_size
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import Cover, Landscape

FBFM13: Mapping[int, int] = (
    dict.fromkeys((*range(1, 8), 93), Cover.GRASSLAND)
    | dict.fromkeys(range(8, 14), Cover.FOREST)
    | {91: Cover.BARE, 92: Cover.BARE, 98: Cover.LAKE, 99: Cover.BARE}
)
"""Cover of each LANDFIRE code of the 13 fuel models (Anderson 1982, USDA Forest Service INT-122).

Grass 1-3 is grassland, and so is shrub 4-7, which carries fire faster than any litter or slash; timber litter 8-10
and slash 11-13 are forest; urban 91, snow or ice 92 and barren 99 bare; water 98 lake. Agriculture 93, which LANDFIRE
calls non-burnable, is grassland: stubble and cured crops carry fire. Nothing is wetland.
"""
TABLES = {"fbfm13": FBFM13}
LARGEST_MAP = 100_000_000  # cells; a raster whose header declares more is refused unread
_HEADER_LINE, _NUMBER = rb"(?i)\s*(ncols|nrows|[xy]ll|cellsize|d[xy]|nodata)", rb"(?i)(?<!\S)(nan|[-+.\de]+)(?!\S)"
_DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid"}


@dataclass(frozen=True, kw_only=True)
class Raster:
    """Real ground: the cover from a fuel or land-cover layer and the elevation, read once and cropped from one grid.

    Attributes:
        path: Folder of the layers; or the fuel layer's file, with the elevation beside it. None is an error. A layer
            is a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc) with one band, north up, in metres.
        size: Side of the crop, or (rows, columns) [cells].
        elevation: File name of the elevation layer [m], or a pattern that one raster in the folder matches; None
            makes a flat world.
        fuel: The same for the layer of class codes; not used where ``path`` is a file.
        table: Cover of each class code: a preset of ``TABLES``, or a mapping to ``Cover`` codes or names.
        row: Top row of the crop in the raster. None, with ``column``, draws a window for each episode.
        column: Left column of the crop in the raster.
        min_fuel: Lowest share of a drawn window where trees can stand, so that there is something to burn.

    Raises:
        ValueError: If a value is out of its range, no window fits, a layer is missing, ambiguous, damaged, enormous,
            empty or on another grid, a code is not whole or not in the table, or rasterio is not installed.
    """

    path: str | PathLike[str] | None = None
    size: tuple[int, int] | int = 64
    elevation: str | None = "*Elev*"
    fuel: str = "*F13*"
    table: Literal["fbfm13"] | Mapping[int, int | str] = "fbfm13"
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    _cell_size: float = field(init=False, repr=False, compare=False)
    _maps: dict[torch.device, list[Any]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        map_size(self.size)
        if not 0.0 <= self.min_fuel <= 1.0:
            raise ValueError(f"min_fuel must be in [0, 1], got {self.min_fuel}")
        table, paths = _code_table(self.table), self._find_layers()
        grids = [_read_grid(name, path) for name, path in paths.items()]
        _check_same(*grids)
        codes, known = _read_pixels("fuel", paths["fuel"])
        cover, elevation = _to_cover(codes, known, table), None
        if "elevation" in paths:
            heights, measured = _read_pixels("elevation", paths["elevation"])
            elevation, known = _to_metres(heights, measured), known & measured
        corners = self._find_corners(torch.from_numpy(known), holds_trees(cover))
        object.__setattr__(self, "_cell_size", grids[0]["cell size"])
        object.__setattr__(self, "_maps", {torch.device("cpu"): [corners, cover, elevation]})

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world's window, batch size [B]."""
        if key.device not in self._maps:
            maps = self._maps[torch.device("cpu")]
            self._maps[key.device] = [each if each is None else each.to(key.device) for each in maps]
        corners, cover, elevation = self._maps[key.device]
        draw = uniform(key, 0, Stream.CROP, (1, 1)).double()  # float32 cannot count past 2^24 windows
        row, column = (torch.arange(side, device=key.device) for side in map_size(self.size))
        cells = corners[(draw * len(corners)).long()] + row[:, None] * cover.shape[1] + column
        cover, elevation = cover.take(cells), None if elevation is None else elevation.take(cells)
        return Landscape(cover=cover, age=draw_age(key, cover), elevation=elevation, batch_size=key.shape)

    @property
    def cell_size(self) -> float:
        """Return the side of a cell from the fuel layer's transform [m]; 30 where the file has none."""
        return self._cell_size

    def _find_layers(self) -> dict[str, Path]:
        if not self.path or not isinstance(self.path, str | PathLike) or not Path(self.path).exists():
            raise ValueError(f"path must name a folder of rasters, or a raster, that exists, got {self.path!r}")
        path = Path(self.path)
        folder = path if path.is_dir() else path.parent
        paths = {"fuel": _find_layer("fuel", folder, self.fuel) if path.is_dir() else path}
        if self.elevation is not None:
            paths["elevation"] = _find_layer("elevation", folder, self.elevation)
        return paths

    def _find_corners(self, known: Tensor, fuel: Tensor) -> Tensor:
        """Return the flat index of the top left cell of each window to draw from, int64 [windows]."""
        height, width = map_size(self.size)
        rows, columns = known.shape
        if height > rows or width > columns:
            raise ValueError(f"size must fit in the raster of {rows} x {columns} cells, got {height} x {width}")
        whole = _sum_windows(~known, height, width) == 0
        if self.row is not None or self.column is not None:
            return torch.tensor([self._fixed_row(whole) * columns + self.column])
        least = max(1, math.ceil(self.min_fuel * height * width - 1e-6))
        row, column = (whole & (_sum_windows(fuel, height, width) >= least)).nonzero().unbind(1)
        if not len(row):
            window = f"window of {height} x {width} cells without nodata and with min_fuel {self.min_fuel:g}"
            raise ValueError(f"size must leave some place, the raster has no {window}")
        return row * columns + column

    def _fixed_row(self, whole: Tensor) -> int:
        """Return ``row`` if it and ``column`` name a window without nodata."""
        for name, count in zip(("row", "column"), whole.shape):
            value = getattr(self, name)
            if not isinstance(value, int) or not 0 <= value < count:
                raise ValueError(f"{name} must be whole, in 0..{count - 1} for a window in the raster, got {value}")
        if not whole[self.row, self.column]:
            raise ValueError(f"row, column must name a window without nodata, got {self.row}, {self.column}")
        return self.row


def _code_table(table: str | Mapping[int, int | str]) -> Mapping[int, int]:
    try:
        pairs = TABLES[table].items() if isinstance(table, str) else table.items()
        return {int(str(code)): Cover[to.upper()] if isinstance(to, str) else Cover(to) for code, to in pairs}
    except (AttributeError, KeyError, TypeError, ValueError):
        covers = ", ".join(cover.name.lower() for cover in Cover)
        rule = f"one of {', '.join(TABLES)}, or map whole codes to 0..{max(Cover)} ({covers})"
        raise ValueError(f"table must be {rule}, got {table}") from None


def _find_layer(name: str, folder: Path, pattern: str) -> Path:
    """Return the one raster of a folder that a file name or a pattern names."""
    if (folder / str(pattern)).is_file():
        return folder / str(pattern)
    matches = sorted(file for file in folder.iterdir() if fnmatchcase(file.name, str(pattern)))
    matches = [file for file in matches if file.suffix.lower() in _DRIVERS] or matches  # not .tif.aux.xml, .prj
    if len(matches) != 1:
        got = ", ".join(file.name for file in matches[:4]) or "none"
        raise ValueError(f"{name} must name one file in {folder}, {pattern!r} matches {len(matches)}: {got}")
    return matches[0]


@contextmanager
def _open(name: str, path: Path) -> Iterator[Any]:
    """Open a layer with the driver that its suffix states; GDAL's errors become one line."""
    try:
        import rasterio
    except ImportError:
        raise ValueError('path must be read with rasterio, which is missing: pip install "warp_torchrl[gis]"') from None
    driver = _DRIVERS.get(path.suffix.lower())
    if driver is None:
        raise ValueError(f"{name} must be a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc), got {path}")
    options = {"datatype": "Float64"} if driver == "AAIGrid" else {}  # left to guess integers, GDAL cuts decimals off
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver, **options)
        with dataset:
            yield dataset
    except (rasterio.errors.RasterioError, OSError) as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise ValueError(f"{name} must be a whole {driver} raster, {path} cannot be read: {reason}") from None


def _read_grid(name: str, path: Path) -> dict[str, Any]:
    """Return a layer's grid from its header, checked before any pixel is read."""
    with _open(name, path) as layer:
        (rows, columns), crs = layer.shape, layer.crs
        if rows * columns > LARGEST_MAP:
            raise ValueError(f"{name} must have at most {LARGEST_MAP} cells, {path} declares {rows} x {columns}")
        if layer.count != 1 or not layer.dtypes[0].startswith(("int", "uint", "float")):
            raise ValueError(f"{name} must have one band of real numbers, {path} has {', '.join(layer.dtypes[:4])}")
        nowhere = layer.transform.is_identity  # no place on Earth, so the cell is ours
        side, skew_x, _, skew_y, down, _ = (30.0, 0.0, 0.0, 0.0, -30.0, 0.0) if nowhere else layer.transform[:6]
        if not max(abs(skew_x), abs(skew_y), abs(side + down)) <= 0.01 * side or (crs and not crs.is_projected):
            raise ValueError(f"{name} must have square cells in metres, north up, {path} has {layer.res} in {crs}")
        cell_size = side * (crs.linear_units_factor[1] if crs else 1.0)
        return {"shape": (rows, columns), "CRS": crs, "bounds": tuple(layer.bounds), "cell size": cell_size}


def _check_same(fuel: dict[str, Any], elevation: dict[str, Any] | None = None) -> None:
    for what, value in (elevation or {}).items():
        near = what in ("bounds", "cell size") and np.allclose(value, fuel[what], rtol=0, atol=0.01 * fuel["cell size"])
        if not near and value != fuel[what]:
            raise ValueError(f"elevation must have the {what} of fuel, {fuel[what]}, got {value}")


def _read_pixels(name: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return a layer's values and where they are known, [H, W]."""
    with _open(name, path) as layer:
        values, known = layer.read(1), layer.read_masks(1) > 0
        if (layer.scales[0], layer.offsets[0]) != (1.0, 0.0):
            values = values.astype(np.float64) * layer.scales[0] + layer.offsets[0]
        if layer.driver == "AAIGrid":  # GDAL reads a word as 0, and skips numbers past the last cell
            with path.open("rb") as lines:
                count = sum(len(re.findall(_NUMBER, line)) for line in lines if not re.match(_HEADER_LINE, line))
            if count != values.size:
                raise ValueError(f"{name} must hold {values.size} numbers after its header, {path} holds {count}")
    if not known.any():
        raise ValueError(f"{name} must hold data, {path} is all nodata")
    return values, known


def _to_cover(codes: np.ndarray, known: np.ndarray, table: Mapping[int, int]) -> Tensor:
    broken = known & (codes != np.rint(codes))
    if broken.any():
        raise ValueError(f"fuel must hold whole class codes, got {codes[broken][0]}")
    cover = np.full(codes.shape, 255, np.uint8)
    for code, to in table.items():
        cover[codes == code] = to
    strange = np.unique(codes[known & (cover == 255)])
    if strange.size:
        listed = ", ".join(f"{code:.0f}" for code in strange[:50]) + ", ..." * (strange.size > 50)
        raise ValueError(f"table must have every code of fuel, it lacks {strange.size}: {listed}")
    return torch.from_numpy(np.where(known, cover, np.uint8(Cover.BARE)))


def _to_metres(heights: np.ndarray, known: np.ndarray) -> Tensor:
    broken = known & ~((heights >= -1000.0) & (heights <= 10_000.0))  # NaN; or nodata undeclared: -9999, 32767
    if broken.any():
        raise ValueError(f"elevation must be in [-1000, 10000] m wherever it is known, got {heights[broken][0]}")
    return torch.from_numpy(np.where(known, heights, 0).astype(np.float32))


def _sum_windows(mask: Tensor, height: int, width: int) -> Tensor:
    """Count the set cells of each window by its top left cell, from a summed-area table, int32 [.., ..]."""
    total = torch.zeros(mask.shape[0] + 1, mask.shape[1] + 1, dtype=torch.int32)
    total[1:, 1:] = mask.cumsum(0, dtype=torch.int32).cumsum(1, dtype=torch.int32)
    return total[height:, width:] - total[:-height, width:] - total[height:, :-width] + total[:-height, :-width]
