"""Landscapes from rasters: fuel or land cover, elevation, and tree age or canopy cover, cropped to the world's size."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.state import OLDEST
from warp_torchrl.world.terrain.crop import CROWN_LAYERS, Crop, Cropped, check_crowns
from warp_torchrl.world.terrain.fuel import LAND_COVER, code_table, is_code, to_cover
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layers import (
    CanopyUnits,
    Layers,
    canopy_plane,
    elevation_unit,
    find_layers,
    read_layers,
    unread_files,
)
from warp_torchrl.world.terrain.planes import (
    check_slopes,
    to_age,
    to_canopy_cover,
    to_forest_age,
    to_fuel,
    to_metres,
    to_worth,
)
from warp_torchrl.world.terrain.resampling import fill
from warp_torchrl.world.terrain.source import map_size

LAYERS = ("fuel", "elevation", "age", "canopy", "canopy_height", *CROWN_LAYERS, "assets")
"""The layers of a map, which have a file name or a pattern each."""


@dataclass(frozen=True, kw_only=True)
class Raster(Cropped):
    """Real ground: the cover from a fuel or land-cover layer and the elevation, read once and cropped from one grid.

    A layer is a band of a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc). The grid is the fuel layer's, which must
    have square cells in metres of the ground, north up, or a grid with cells of ``resolution``. Without a CRS, as in
    ASCII grids, its unit is assumed to be the metre, with a warning.

    Attributes:
        path: Folder of the layers; or the fuel layer's file, with the others beside it. None is an error.
        size: Side of the crop, or (rows, columns) [cells].
        elevation: File name of the elevation layer, or a pattern that one raster in the folder matches; None makes a
            flat world.
        elevation_unit: Metres per unit of that layer, 0.3048 for feet; None takes the unit that the file states, of its
            band or its vertical CRS, else metres. It is required if the map is in feet and the file states no unit, or
            if metres are too steep to be true.
        fuel: The same for the layer of class codes; not used where ``path`` is a file. Laws of rates of spread read the
            codes unchanged.
        table: Cover of each class code: a preset of ``fuel.TABLES``, or a mapping to ``Cover`` codes or names, or a
            yaml file of one.
        nodata: Cells whose fuel or elevation is not known: ``refuse`` leaves no world there; ``unburnable`` gives cells
            without fuel ``fuel.NO_FUEL_CODE`` and bare cover, and cells without elevation that of the cells around.
        ages: Ages without a layer of ages: ``drawn`` draws the trees' ages for each episode, as the paper does;
            ``oldest`` gives all the oldest, 10, so that every cell of fuel can burn.
        age: The same for a layer of tree ages, in any unit; None leaves them to ``ages``. A tree's code is
            10 x value / ``full_age``, 10 at most, halves up; where it is 0 nothing stands. Where the layer has
            nodata, as age maps have outside of forests, the age is drawn.
        full_age: Value of the age layer from which a tree counts as oldest [its unit].
        canopy: The same for a layer of canopy cover [%]. Where ages are drawn it determines those of forest cells: code
            = canopy / 10, halves up, 1 at least. It says nothing about grass, shrub or wetland, where LANDFIRE has 0
            over grass and a mixture over shrub, so there, and under nodata, the age is drawn. A forest cell without
            canopy keeps a young tree, code 1, since its fuel is timber and code 0 is bare ground or ash.
        canopy_height: The same for a layer of the height of the canopy's top; nodata is 0.
        canopy_base_height: The same for a layer of the height of the crowns' base, and
        canopy_bulk_density: of what burns in crowns; nodata is 0. With both, and with ``canopy`` and ``canopy_height``,
            fires of law ``rate`` run in crowns.
        height_unit: Metres per unit of the layers of heights, required if a file does not state it: 0.1 for LANDFIRE's
            CH and CBH, 1 for metres.
        density_unit: kg/m3 per unit of the bulk density, the same: 0.01 for LANDFIRE's CBD, 1 for kg/m3.
        assets: The same for a layer of the worth of each cell, 0 or more in any unit, for rewards that use it; nodata
            is 0. Or GeoJSON or a shapefile: a cell's worth is the sum over the shapes in it of their property ``worth``
            or ``value``, or 1. None leaves all alike.
        bands: Number or description of a layer's band, by the layer's name: ``{fuel: 4, elevation: 1}``. In a file with
            several bands the others are found by their descriptions, as LANDFIRE and FlamMap write them.
        resample: Layers on another grid: ``refuse`` makes them an error; ``nearest`` and ``mode`` (the most frequent
            class) put class codes on the grid, and both interpolate elevation, age and canopy (bilinear). See
            ``resample_layer``.
        resolution: Side of the grid's cells [m], a grid over the fuel layer from its north-west corner on, in the
            fuel layer's CRS; in the UTM zone of its middle where that is in degrees, as ESA WorldCover is, or has other
            metres than the ground, as Web Mercator. None keeps the fuel layer's grid. It needs ``resample``.
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
    elevation_unit: float | None = None
    fuel: str = "*F13*"
    table: str | PathLike[str] | Mapping[int, int | str] = "fbfm13"
    nodata: Literal["refuse", "unburnable"] = "refuse"
    ages: Literal["drawn", "oldest"] = "drawn"
    age: str | None = None
    full_age: float = 10.0
    canopy: str | None = None
    canopy_height: str | None = None
    canopy_base_height: str | None = None
    canopy_bulk_density: str | None = None
    height_unit: float | None = None
    density_unit: float | None = None
    assets: str | None = None
    bands: Mapping[str, int | str] = field(default_factory=dict)
    resample: Literal["refuse", "nearest", "mode"] = "refuse"
    resolution: float | None = None
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    _grid: Grid = field(init=False, repr=False, compare=False)
    _files: tuple[str, ...] = field(init=False, repr=False, compare=False)
    _paths: tuple[Path, ...] = field(init=False, repr=False, compare=False)  # of the layers, the fuel's first

    def __post_init__(self) -> None:
        check_fields(
            self,
            full_age=(1e-6, 1e6),
            elevation_unit=(1e-3, 10.0),
            height_unit=(1e-3, 10.0),
            density_unit=(1e-3, 10.0),
            resolution=(0.1, 100_000.0),
            min_fuel=(0.0, 1.0),
        )
        map_size(self.size)
        self._check_together()
        table = code_table(self.table)
        paths = find_layers(self.path, {name: getattr(self, name) for name in LAYERS})
        layers = read_layers(paths, self.bands, self.resample, self.resolution)
        object.__setattr__(self, "_grid", layers.grid)
        layers.known["fuel"] &= is_code(layers.values["fuel"], table)
        planes, units = self._make_planes(layers, table)
        crop = Crop(**planes, size=self.size, row=self.row, column=self.column, min_fuel=self.min_fuel)
        object.__setattr__(self, "_files", self._file_lines(layers, units))
        object.__setattr__(self, "_paths", tuple(paths.values()))
        object.__setattr__(self, "_crop", crop)

    @property
    def grid(self) -> Grid:
        """Return the grid of the map; every world is a window of it."""
        return self._grid

    @property
    def cell_size(self) -> float:
        """Return the side of a cell of the grid [m]; 30 where the fuel layer has no place on Earth."""
        return self._grid.cell_size

    @property
    def files(self) -> tuple[str, ...]:
        """Return a line for each file: its layer, its unit, and the bands that are not read."""
        return self._files

    def unread(self, *others: str | PathLike[str]) -> list[str]:
        """Return the names of the rasters and vector files beside the fuel layer that are not read.

        Args:
            others: Files that are read for something else, such as the ignition.
        """
        return unread_files(self._paths[0].parent, [*self._paths, *map(Path, others)])

    def _check_together(self) -> None:
        if self.age is not None and self.canopy is not None:
            raise ValueError(f"canopy must be null where age makes the trees, got {self.canopy} and {self.age}")
        if self.age is not None and self.ages == "oldest":
            raise ValueError(f"ages must be drawn where age, {self.age}, tells them, got oldest")
        check_crowns(tuple(name for name in LAYERS if getattr(self, name) is not None), ("canopy", "canopy_height"))
        if self.resolution is not None and self.resample == "refuse":
            raise ValueError(f"resample must be nearest or mode where resolution is {self.resolution:g}, got refuse")

    def _make_planes(self, layers: Layers, table: Mapping[int, int]) -> tuple[dict[str, Any], dict[str, str]]:
        """Return the planes of the map, and where it is known, by their names in ``Crop``; and the units of layers."""
        values, known, units = layers.values, layers.known, {}
        cover = to_cover(values["fuel"], known["fuel"], table)
        planes: dict[str, Any] = {"cover": cover}
        if self.table not in LAND_COVER:
            planes["fuel"] = to_fuel(values["fuel"], known["fuel"])
        if "elevation" in values:
            unit = elevation_unit(layers.headers["elevation"], self.elevation_unit)
            metres, units["elevation"] = to_metres(values["elevation"], known["elevation"], unit), _length(unit)
            if self.elevation_unit is None and not layers.headers["elevation"].unit:
                check_slopes(metres, known["elevation"], self.cell_size)
            planes["elevation"] = metres if self.nodata == "refuse" else fill(metres, known["elevation"])
        if "age" in values:
            planes["age"] = to_age("age", values["age"], known["age"], self.full_age)
        if "canopy" in values:
            planes["age"] = to_forest_age(cover, values["canopy"], known["canopy"])
            planes["canopy_cover"] = to_canopy_cover(values["canopy"], known["canopy"])
            units["canopy"] = "%"
        told = CanopyUnits(self.height_unit, self.density_unit)
        for name in ("canopy_height", *CROWN_LAYERS):
            if name in values:
                planes[name], units[name] = canopy_plane(name, values[name], known[name], layers.headers[name], told)
        if "assets" in values:
            planes["assets"] = to_worth(values["assets"], known["assets"])
        if self.ages == "oldest":
            planes["age"] = np.full(cover.shape, OLDEST, np.uint8)
        whole = known["fuel"] & known.get("elevation", known["fuel"])
        return {**planes, "known": whole if self.nodata == "refuse" else None}, units

    def _file_lines(self, layers: Layers, units: Mapping[str, str]) -> tuple[str, ...]:
        """Return a line for each file, with the bands that are not read."""
        named = self.table if isinstance(self.table, str) else "a table of your own"
        units = {"fuel": f"codes of {named}", **units}
        lines = []
        for name, path in layers.paths.items():
            header = layers.headers.get(name)
            described = path.name if header is None else header.description
            lines.append(f"{name}: {described}" + (f" [{units[name]}]" if name in units else ""))
        read = {(each.path, each.number) for each in layers.headers.values()}
        for path, bands in {each.path: each.bands for each in layers.headers.values()}.items():
            left = [band for number, band in enumerate(bands, start=1) if (path, number) not in read]
            if left:
                lines.append(f"bands of {path.name} that are not read: {', '.join(left)}")
        return tuple(lines)


def _length(unit: float) -> str:
    return "m" if unit == 1.0 else f"{unit:g} m"
