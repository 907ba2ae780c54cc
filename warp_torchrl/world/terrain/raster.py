"""Landscapes from rasters: fuel or land cover, elevation, and tree age or canopy cover, cropped to the world's size."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warp_torchrl.validation import check_fields
from warp_torchrl.world.state import OLDEST
from warp_torchrl.world.terrain.crop import Crop, Cropped
from warp_torchrl.world.terrain.fuel import LAND_COVER, NO_DATA, code_table, to_cover
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.landscape import map_size
from warp_torchrl.world.terrain.layer import fill, find_layer, read_grid, read_layer, regrid, resample_layer
from warp_torchrl.world.terrain.planes import (
    read_worth,
    to_age,
    to_canopy_cover,
    to_canopy_height,
    to_forest_age,
    to_fuel,
    to_metres,
    to_worth,
)
from warp_torchrl.world.terrain.vector import SUFFIXES

_log = logging.getLogger("warp_torchrl")


@dataclass(frozen=True, kw_only=True)
class Raster(Cropped):
    """Real ground: the cover from a fuel or land-cover layer and the elevation, read once and cropped from one grid.

    A layer is a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc) with one band. The grid is the fuel layer's, which
    must have square cells in metres, north up, or one of cells of ``resolution``. Where it has no CRS, as ASCII grids
    have none, its unit is taken to be the metre, and a warning says so.

    Attributes:
        path: Folder of the layers; or the fuel layer's file, with the others beside it. None is an error.
        size: Side of the crop, or (rows, columns) [cells].
        elevation: File name of the elevation layer [m], or a pattern that one raster in the folder matches; None
            makes a flat world.
        fuel: The same for the layer of class codes; not used where ``path`` is a file. Laws of rates of spread read the
            codes as they stand there.
        table: Cover of each class code: a preset of ``fuel.TABLES``, or a mapping to ``Cover`` codes or names, or a
            yaml file of one.
        nodata: What cells are where the fuel or the elevation is not known: ``refuse`` leaves no world there;
            ``unburnable`` makes cells without fuel of them, ``fuel.NO_FUEL`` and bare, and gives cells without
            elevation that of the cells around.
        ages: ``drawn`` draws the trees' ages for each episode where no layer tells them, as the paper does;
            ``oldest`` gives all the oldest, 10, so that every cell of fuel can burn.
        age: The same for a layer of tree ages, in any unit; None leaves them to ``ages``. A tree's code is
            10 x value / ``full_age``, 10 at most, halves up; where it is 0 nothing stands. Where the layer has
            nodata, as age maps have outside of forests, the age is drawn.
        full_age: Value of the age layer from which a tree counts as oldest [its unit].
        canopy: The same for a layer of canopy cover [%]. Where ages are drawn it makes those of the trees of forest
            cells: code = canopy / 10, halves up, 1 at least. It tells nothing of grass, shrub or wetland, where
            LANDFIRE has 0 over grass and a mixture over shrub, so there, and under nodata, the age is drawn. A forest
            cell without canopy keeps a young tree, code 1, since its fuel is timber and code 0 is bare ground or ash.
        canopy_height: The same for a layer of the height of the canopy's top; nodata is 0.
        height_unit: Metres to a unit of that layer, which must be told: 0.1 for LANDFIRE's CH, 1 for metres.
        assets: The same for a layer of what each cell is worth, 0 or more in any unit, for rewards that ask; nodata is
            0. Or for GeoJSON or a shapefile, where a cell is worth the sum of what lies in it, each shape's property
            ``worth`` or ``value``, or 1. None leaves all alike.
        resample: What becomes of layers on another grid: ``refuse`` makes them an error; ``nearest`` and ``mode``
            (the most frequent class) are how class codes are put on the grid, elevation, age and canopy being
            interpolated (bilinear) in both. See ``resample_layer``.
        resolution: Side of the grid's cells [m], a grid over the fuel layer from its north-west corner on, in the
            fuel layer's CRS; in the UTM zone of its middle where that is in degrees, as ESA WorldCover is. None keeps
            the fuel layer's grid. It needs ``resample``.
        row: Top row of the crop in the grid. None, with ``column``, draws a window for each episode.
        column: Left column of the crop in the grid.
        min_fuel: Lowest share of a drawn window where trees can stand, so that there is something to burn.

    Raises:
        ValueError: If a value is out of its range or contradicts another, no window fits, a layer is missing,
            ambiguous, damaged, enormous, empty or on another grid, a code is not whole or not in the table, or rasterio
            is not installed.
    """

    path: str | PathLike[str] | None = None
    size: tuple[int, int] | int = 64
    elevation: str | None = "*Elev*"
    fuel: str = "*F13*"
    table: str | PathLike[str] | Mapping[int, int | str] = "fbfm13"
    nodata: Literal["refuse", "unburnable"] = "refuse"
    ages: Literal["drawn", "oldest"] = "drawn"
    age: str | None = None
    full_age: float = 10.0
    canopy: str | None = None
    canopy_height: str | None = None
    height_unit: float | None = None
    assets: str | None = None
    resample: Literal["refuse", "nearest", "mode"] = "refuse"
    resolution: float | None = None
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    _grid: Grid = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_fields(
            self,
            full_age=(1e-6, 1e6),
            height_unit=(1e-3, 10.0),
            resolution=(0.1, 100_000.0),
            min_fuel=(0.0, 1.0),
        )
        map_size(self.size)
        self._check_together()
        table, paths = code_table(self.table), self._find_layers()
        layers, known = self._read_layers(paths)
        if NO_DATA not in table:
            known["fuel"] = known["fuel"] & (layers["fuel"] != NO_DATA)
        crop = Crop(
            **self._make_planes(layers, known, table),
            size=self.size,
            row=self.row,
            column=self.column,
            min_fuel=self.min_fuel,
        )
        object.__setattr__(self, "_crop", crop)

    @property
    def grid(self) -> Grid:
        """Return the grid in force, of which every world is a window."""
        return self._grid

    @property
    def cell_size(self) -> float:
        """Return the side of a cell of the grid [m]; 30 where the fuel layer has no place on Earth."""
        return self._grid.cell_size

    def _check_together(self) -> None:
        if self.age is not None and self.canopy is not None:
            raise ValueError(f"canopy must be null where age makes the trees, got {self.canopy} and {self.age}")
        if self.age is not None and self.ages == "oldest":
            raise ValueError(f"ages must be drawn where age, {self.age}, tells them, got oldest")
        if self.canopy_height is not None and self.height_unit is None:
            raise ValueError("height_unit must be given with canopy_height, 0.1 for LANDFIRE or 1 for metres, got None")
        if self.resolution is not None and self.resample == "refuse":
            raise ValueError(f"resample must be nearest or mode where resolution is {self.resolution:g}, got refuse")

    def _make_planes(
        self, layers: Mapping[str, np.ndarray], known: Mapping[str, np.ndarray], table: Mapping[int, int]
    ) -> dict[str, Any]:
        """Return the planes of the map, and where it is known, by their names in ``Crop``."""
        cover = to_cover(layers["fuel"], known["fuel"], table)
        planes: dict[str, Any] = {"cover": cover}
        if self.table not in LAND_COVER:
            planes["fuel"] = to_fuel(layers["fuel"], known["fuel"])
        if "elevation" in layers:
            metres = to_metres(layers["elevation"], known["elevation"])
            planes["elevation"] = metres if self.nodata == "refuse" else fill(metres, known["elevation"])
        if "age" in layers:
            planes["age"] = to_age("age", layers["age"], known["age"], self.full_age)
        if "canopy" in layers:
            planes["age"] = to_forest_age(cover, layers["canopy"], known["canopy"])
            planes["canopy_cover"] = to_canopy_cover(layers["canopy"], known["canopy"])
        if self.height_unit is not None and "canopy_height" in layers:
            planes["canopy_height"] = to_canopy_height(
                layers["canopy_height"], known["canopy_height"], self.height_unit
            )
        if "assets" in layers:
            planes["assets"] = to_worth(layers["assets"], known["assets"])
        if self.ages == "oldest":
            planes["age"] = np.full(cover.shape, OLDEST, np.uint8)
        whole = known["fuel"] & known.get("elevation", known["fuel"])
        return {**planes, "known": whole if self.nodata == "refuse" else None}

    def _find_layers(self) -> dict[str, Path]:
        try:
            exists = isinstance(self.path, str | PathLike) and self.path and Path(self.path).exists()
        except OSError:  # a name too long
            exists = False
        if self.path is None or not exists:
            raise ValueError(f"path must name a folder of rasters, or a raster, that exists, got {self.path!r}")
        path = Path(self.path)
        folder = path if path.is_dir() else path.parent
        paths = {"fuel": find_layer("fuel", folder, self.fuel) if path.is_dir() else path}
        for name in ("elevation", "age", "canopy", "canopy_height", "assets"):
            if getattr(self, name) is not None:
                paths[name] = find_layer(name, folder, getattr(self, name))
        return paths

    def _read_layers(self, paths: Mapping[str, Path]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Return the values of each layer on the grid, and where they are known; every header is checked first."""
        strict = self.resample == "refuse"
        vector = "assets" in paths and paths["assets"].suffix.lower() in SUFFIXES
        shapes = paths["assets"] if vector else None
        paths = {name: path for name, path in paths.items() if not (vector and name == "assets")}
        grid = read_grid("fuel", paths["fuel"], self.resolution is None, remedy="resolution=30 resample=mode")
        if not grid.crs:
            _tell_once(f"{paths['fuel']} has no CRS: its cells are taken as squares of {grid.cell_size:g} m")
        grids = {"fuel": grid}
        if self.resolution is not None:
            grid = regrid("fuel", grid, self.resolution)
        object.__setattr__(self, "_grid", grid)
        for name in paths.keys() - grids.keys():
            grids[name] = read_grid(name, paths[name], metric=strict)
            if strict:
                check_grid(name, grids[name], "fuel", grid)
        layers, known = {}, {}
        if shapes is not None:
            layers["assets"], known["assets"] = read_worth(shapes, grid), np.ones(grid.shape, bool)
        for name, path in paths.items():
            if grids[name].differs_in(grid) is None:
                layers[name], known[name] = read_layer(name, path)
            else:
                method = self.resample if name == "fuel" else "bilinear"  # "refuse" has raised by now
                layers[name], known[name] = resample_layer(name, path, grid, method)  # type: ignore[arg-type]
        return layers, known


@cache
def _tell_once(line: str) -> None:
    _log.warning(line)
