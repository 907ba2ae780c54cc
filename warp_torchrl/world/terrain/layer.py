"""One raster layer: its file, its grid from the header, its values, and where they are known.

A layer is a band of real numbers in a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc). An error is one line that
begins with the name of the layer; the header is checked before a value is read.
"""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from warp_torchrl.world.terrain.bands import band_names, band_unit, choose_band
from warp_torchrl.world.terrain.crs import check_crs
from warp_torchrl.world.terrain.gdal import reading
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.vector import SUFFIXES

LARGEST_MAP = 100_000_000
"""Most cells of a map that is read; a header that declares more is refused."""
RASTERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid"}
"""Kinds of files of rasters, and GDAL's driver of each: no other reads them, whatever they hold."""
NO_DATA = -9999
"""What cells hold that are not known, in an ASCII grid that does not say: the default of ESRI's format."""
ALONE = "write the one that is meant into a file of its own, gdal_translate -b NUMBER"
"""What the user does where a band cannot be chosen by a key."""
_HEADER_LINE, _NUMBER = rb"(?i)\s*(ncols|nrows|[xy]ll|cellsize|d[xy]|nodata)", rb"(?i)(?<!\S)(nan|[-+.\de]+)(?!\S)"
_NODATA_LINE = rb"(?i)\s*nodata"
_HEADER_LINES = 12  # of an ASCII grid at most
_NO_POINT = rb"(?i)\s*([a-z]\w*\s+[-+\d]*,(?!0*\s*$)\S*)"  # GDAL reads 12,5 as 12
_WORLD_FILES = (".tfw", ".tifw", ".tiffw", ".wld")
_LARGEST_PRJ = 100_000  # bytes


class Header(NamedTuple):
    """Header of a layer."""

    path: Path
    grid: Grid
    number: int  # of the band, from 1
    bands: list[str]  # descriptions of all bands, or their numbers
    unit: str  # that the band states; nothing where it states none
    dtype: str

    @property
    def description(self) -> str:
        """Return the file and the band in words."""
        band = f", band {self.bands[self.number - 1]}" if len(self.bands) > 1 else ""
        return f"{self.path.name}{band}"


def find_layer(name: str, folder: Path, pattern: str) -> Path:
    """Return the only raster of a folder that matches a file name, or a pattern such as ``*Elev*``.

    Raises:
        ValueError: If none does, or several do, or the folder cannot be read.
    """
    try:
        if (folder / str(pattern)).is_file():
            return folder / str(pattern)
        matches = sorted(file for file in folder.iterdir() if fnmatchcase(file.name, str(pattern)))
    except OSError as error:  # no permission, a name too long
        raise ValueError(f"{name} must name one file in {folder}, {pattern!r} does not: {error.strerror}") from None
    kinds = (*RASTERS, *SUFFIXES) if name == "assets" else RASTERS
    matches = [file for file in matches if file.suffix.lower() in kinds] or matches  # not .tif.aux.xml, .prj
    if len(matches) != 1:
        got = ", ".join(file.name for file in matches[:4]) or "none"
        raise ValueError(f"{name} must name one file in {folder}, {pattern!r} matches {len(matches)}: {got}")
    return matches[0]


def read_header(
    name: str,
    path: Path,
    metric: bool = True,
    remedy: str = "resample",
    band: int | str | None = None,
    key: str = ALONE,
) -> Header:
    """Return a layer's header.

    Args:
        name: Name of the layer in messages.
        path: Its file.
        metric: Refuse cells that are not squares in metres, north up, and on the ground. False for a layer that will be
            resampled.
        remedy: Option that resamples the layer, for messages.
        band: Number or description of its band; None takes the only one, or the one whose description is the layer's.
        key: How the user chooses the band, for messages.

    Raises:
        ValueError: If the file cannot be read, is enormous, or has other than real numbers, or no band is the layer's.
    """
    with _open(name, path) as layer:
        (rows, columns), crs = layer.shape, check_crs(name, layer.crs)
        if rows * columns > LARGEST_MAP:
            raise ValueError(f"{name} must have at most {LARGEST_MAP} cells, {path} declares {rows} x {columns}")
        number = choose_band(name, path, layer, band, key)
        dtype = layer.dtypes[number - 1]
        if not dtype.startswith(("int", "uint", "float")):
            raise ValueError(f"{name} must have one band of real numbers, {path} has {dtype}")
        grid = Grid((rows, columns), crs, layer.transform)
        header = Header(path, grid, number, band_names(layer), band_unit(layer, number), dtype)
    _check_place(name, path, grid)
    if metric:
        hint = f"; give {remedy} to put it on such cells" if grid.is_on_earth else ""
        if not grid.is_metric:
            has = f"{path} has {_cell(grid)} in {crs or 'no CRS'}"
            raise ValueError(f"{name} must have square cells in metres, north up, {has}{hint}")
        if grid.distortion:
            has = f"{path} in {crs} has {grid.distortion}"
            raise ValueError(f"{name} must have square cells in metres of the ground, {has}{hint}")
    return header


def read_grid(name: str, path: Path, metric: bool = True, remedy: str = "resample") -> Grid:
    """Return a layer's grid; see ``read_header``."""
    return read_header(name, path, metric, remedy).grid


def read_layer(name: str, path: Path, number: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return a layer's values, with the scale and offset of its file, and where they are known, [H, W] and bool.

    In an ASCII grid whose header does not say what nodata is, it is -9999.

    Args:
        name: What the layer is, for messages.
        path: Its file.
        number: Of its band, from ``read_header``; None finds it as that does.

    Raises:
        ValueError: If the file is cut or damaged, holds no data, or a word stands among the numbers of a text grid.
    """
    number = read_header(name, path, metric=False).number if number is None else number
    with _open(name, path) as layer:
        values, known = layer.read(number), layer.read_masks(number) > 0
        if (layer.scales[number - 1], layer.offsets[number - 1]) != (1.0, 0.0):
            values = values.astype(np.float64) * layer.scales[number - 1] + layer.offsets[number - 1]
        if layer.driver == "AAIGrid":  # GDAL reads a word as 0, and skips numbers past the last cell
            with path.open("rb") as lines:
                count = sum(len(re.findall(_NUMBER, line)) for line in lines if not re.match(_HEADER_LINE, line))
            if count != values.size:
                raise ValueError(f"{name} must hold {values.size} numbers after its header, {path} holds {count}")
            known &= (values != NO_DATA) | _states_nodata(path)
    if not known.any():
        raise ValueError(f"{name} must hold data, {path} is all nodata")
    return values, known


def _states_nodata(path: Path) -> bool:
    """Return whether the header of an ASCII grid defines nodata."""
    with path.open("rb") as lines:
        return any(re.match(_NODATA_LINE, line) for _, line in zip(range(_HEADER_LINES), lines))


def _check_points(name: str, path: Path) -> None:
    """Refuse an ASCII grid whose header has decimal commas."""
    with path.open("rb") as lines:
        found = (re.match(_NO_POINT, line) for _, line in zip(range(_HEADER_LINES), lines))
        for line in filter(None, found):
            got = line[1].decode(errors="replace")
            raise ValueError(f"{name} must have decimal points in its header, {path} has {got!r}")


def _check_place(name: str, path: Path, grid: Grid) -> None:
    """Refuse a GeoTIFF without a place that has a world file beside it, which is not read."""
    beside = [path.with_suffix(each) for each in _WORLD_FILES if path.with_suffix(each).is_file()]
    if beside and not grid.is_placed:
        rule = f"hold its place, which stands beside it in {beside[0].name}"
        raise ValueError(f"{name} must {rule}, {path} does not: gdal_translate puts it into a file")


def _cell(grid: Grid) -> tuple[float, float]:
    a, _, _, _, e, _ = grid.transform[:6]
    return abs(a), abs(e)


@contextmanager
def _open(name: str, path: Path) -> Iterator[Any]:
    """Open a layer with the driver that its suffix states; GDAL's errors become one line."""
    driver = RASTERS.get(path.suffix.lower())
    if driver is None:
        raise ValueError(f"{name} must be a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc), got {path}")
    options = {"datatype": "Float64"} if driver == "AAIGrid" else {}  # left to guess integers, GDAL cuts decimals off
    with reading(f"{name} must be a whole {driver} raster, {path} cannot be read") as rasterio:
        projection = path.with_suffix(".prj")
        if driver == "AAIGrid" and projection.is_file() and projection.stat().st_size > _LARGEST_PRJ:
            raise ValueError(f"{name} must have a .prj of at most {_LARGEST_PRJ} bytes, {projection} is larger")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver, **options)
        with dataset:
            if driver == "AAIGrid":
                _check_points(name, path)
            if driver == "AAIGrid" and projection.is_file() and not dataset.crs:
                raise ValueError(f"{name} must have a .prj that states a CRS in WKT, {projection} states none")
            yield dataset
