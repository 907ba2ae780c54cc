"""One raster layer: its file, its grid from the header, its values, and its values on another grid.

A layer is a GeoTIFF (.tif, .tiff) or an ESRI ASCII grid (.asc) with one band of real numbers. What is wrong with a
file is one line that begins with the name of the layer; what the header tells is refused before a value is read.
"""

import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warp_torchrl.world.terrain.grid import Grid

Method = Literal["nearest", "mode", "bilinear"]
"""How values are put on another grid."""
LARGEST_MAP = 100_000_000
"""Most cells of a map that is read; a header that declares more is refused."""
_HEADER_LINE, _NUMBER = rb"(?i)\s*(ncols|nrows|[xy]ll|cellsize|d[xy]|nodata)", rb"(?i)(?<!\S)(nan|[-+.\de]+)(?!\S)"
_DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid"}
_UNKNOWN = -(2.0**31)  # the class that stands for nodata while classes are resampled; exact in float32


def find_layer(name: str, folder: Path, pattern: str) -> Path:
    """Return the one raster of a folder that a file name, or a pattern such as ``*Elev*``, names.

    Raises:
        ValueError: If none does, or several do, or the folder cannot be read.
    """
    try:
        if (folder / str(pattern)).is_file():
            return folder / str(pattern)
        matches = sorted(file for file in folder.iterdir() if fnmatchcase(file.name, str(pattern)))
    except OSError as error:  # no permission, a name too long
        raise ValueError(f"{name} must name one file in {folder}, {pattern!r} does not: {error.strerror}") from None
    matches = [file for file in matches if file.suffix.lower() in _DRIVERS] or matches  # not .tif.aux.xml, .prj
    if len(matches) != 1:
        got = ", ".join(file.name for file in matches[:4]) or "none"
        raise ValueError(f"{name} must name one file in {folder}, {pattern!r} matches {len(matches)}: {got}")
    return matches[0]


def read_grid(name: str, path: Path, metric: bool = True, remedy: str = "resample") -> Grid:
    """Return a layer's grid; only the header is read.

    Args:
        name: What the layer is, for messages.
        path: Its file.
        metric: Refuse cells that are not squares in metres, north up. False for a layer that is to be resampled.
        remedy: What the user gives to have it resampled, for messages.

    Raises:
        ValueError: If the file cannot be read, is enormous, or has more than a band or other than real numbers.
    """
    with _open(name, path) as layer:
        (rows, columns), crs = layer.shape, layer.crs or None
        if rows * columns > LARGEST_MAP:
            raise ValueError(f"{name} must have at most {LARGEST_MAP} cells, {path} declares {rows} x {columns}")
        if layer.count != 1 or not layer.dtypes[0].startswith(("int", "uint", "float")):
            raise ValueError(f"{name} must have one band of real numbers, {path} has {', '.join(layer.dtypes[:4])}")
        grid = Grid((rows, columns), crs, layer.transform)
        if metric and not grid.is_metric:
            has = f"{path} has {layer.res} in {crs or 'no CRS'}"
            hint = f"; give {remedy} to put it on such cells" if grid.is_on_earth else ""
            raise ValueError(f"{name} must have square cells in metres, north up, {has}{hint}")
        return grid


def read_layer(name: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return a layer's values, with the scale and offset of its file, and where they are known, [H, W] and bool.

    Raises:
        ValueError: If the file is cut or damaged, holds no data, or a word stands among the numbers of a text grid.
    """
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


def resample_layer(name: str, path: Path, grid: Grid, method: Method) -> tuple[np.ndarray, np.ndarray]:
    """Return a layer's values on another grid, which may have another CRS, and where they are known.

    Args:
        name: What the layer is, for messages.
        path: Its file.
        grid: The grid to put it on.
        method: GDAL's ``nearest`` takes the value of the cell that the new cell's middle lies in; ``mode`` the value
            that most cells under the new one have, nodata being a value too; ``bilinear`` interpolates between the
            middles of the known cells around, and where cells get larger weighs all that the new one and half its
            neighbours cover. A new cell whose middle lies on nodata or off the layer is unknown in ``nearest`` and
            ``bilinear``; in ``mode`` one that lies off it as a whole.

    Returns:
        float64 and bool, [H, W] of ``grid``.

    Raises:
        ValueError: As ``read_grid`` and ``read_layer``; or if either grid has no CRS, or they do not overlap.
    """
    source = read_grid(name, path, metric=False)
    _check_overlap(name, source, grid)
    return resample(name, *read_layer(name, path), source, grid, method)


def resample(
    name: str, values: np.ndarray, known: np.ndarray, source: Grid, grid: Grid, method: Method
) -> tuple[np.ndarray, np.ndarray]:
    """Return values of one grid on another; see ``resample_layer``.

    Args:
        name: What the layer is, for messages.
        values: Its values, [rows, columns] of ``source``.
        known: Where they are known, bool.
        source: The grid that they are on.
        grid: The grid to put them on.
        method: ``nearest``, ``mode`` or ``bilinear``.

    Returns:
        float64 and bool, [H, W] of ``grid``.

    Raises:
        ValueError: If either grid has no CRS, they do not overlap, or one cannot be reached from the other.
    """
    _check_overlap(name, source, grid)
    from rasterio.warp import Resampling, reproject

    hole = math.nan if method == "bilinear" else _UNKNOWN
    target = np.full(grid.shape, hole)
    nodata = {"src_nodata": hole, "dst_nodata": hole} if method == "bilinear" else {}
    places = {"src_transform": source.transform, "src_crs": source.crs}
    places |= {"dst_transform": grid.transform, "dst_crs": grid.crs}
    values = np.where(known, values, hole).astype(np.float64)
    with _gdal_errors(f"{name} must be resampled to {grid.crs}, which fails"):
        reproject(values, target, **places, **nodata, resampling=Resampling[method], init_dest_nodata=False)
    known = ~np.isnan(target) if method == "bilinear" else target != _UNKNOWN
    if not known.any():
        raise ValueError(f"{name} must hold data where it is resampled to, {grid.bounds}, it has none there")
    return target, known


def fill(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values [H, W] with what is not known interpolated from the known cells around, 100 cells off at most.

    Cells farther off get the mean of all that are known.
    """
    from rasterio.fill import fillnodata

    if known.all():
        return values
    filled = fillnodata(np.where(known, values, math.nan), mask=known, max_search_distance=100.0)
    return np.where(np.isnan(filled), values[known].mean(), filled).astype(values.dtype)


def regrid(name: str, grid: Grid, resolution: float) -> Grid:
    """Return the grid of square cells, whole ones only, that covers another from its north-west corner on.

    A grid in degrees becomes one of the UTM zone of its middle; a projected one keeps its CRS.

    Args:
        name: Whose grid it is, for messages.
        grid: The grid to cover.
        resolution: Side of the new cells [m].

    Raises:
        ValueError: If the grid has no CRS, lies too near a pole for UTM, or makes no cell or too many.
    """
    from rasterio import Affine

    if not grid.is_on_earth:
        raise ValueError(f"{name} must have a CRS, projected or in degrees, to be resampled, got {grid.crs}")
    crs = grid.crs if grid.crs.is_projected else _find_utm(name, grid)
    west, south, east, north = _project_bounds(name, grid, crs)
    side = resolution / crs.linear_units_factor[1]
    sides = [(north - south) / side + 1e-6, (east - west) / side + 1e-6]  # 6 cells are 5.999.. in floating point
    if not all(1 <= each <= LARGEST_MAP for each in sides) or int(sides[0]) * int(sides[1]) > LARGEST_MAP:
        rule = f"give 1 to {LARGEST_MAP} cells on {name}"
        raise ValueError(f"resolution must {rule}, got {resolution:g} m for {sides[0]:.1f} x {sides[1]:.1f} cells")
    return Grid((int(sides[0]), int(sides[1])), crs, Affine(side, 0.0, west, 0.0, -side, north))


def _find_utm(name: str, grid: Grid) -> Any:
    """Return the UTM zone of a grid's middle."""
    from rasterio.crs import CRS

    west, south, east, north = _project_bounds(name, grid, CRS.from_epsg(4326))
    longitude, latitude = (west + east) / 2, (south + north) / 2
    if not (-80.0 <= latitude <= 84.0 and -180.0 <= longitude <= 180.0):
        raise ValueError(f"{name} must lie in 80 S to 84 N to be put on a UTM grid, its middle is at {latitude:g}")
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return CRS.from_epsg((32600 if latitude >= 0.0 else 32700) + zone)


def _project_bounds(name: str, grid: Grid, crs: Any) -> tuple[float, float, float, float]:
    """Return a grid's (west, south, east, north) in another CRS; infinite where it cannot be seen there."""
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import RasterioError
    from rasterio.warp import transform_bounds

    if crs == grid.crs:
        return grid.bounds
    try:
        return transform_bounds(grid.crs, crs, *grid.bounds)
    except (CPLE_BaseError, RasterioError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{name} must have a CRS that {crs} can be reached from, got {grid.crs}: {reason}") from None


def _check_overlap(name: str, source: Grid, grid: Grid) -> None:
    if not (source.is_on_earth and grid.is_on_earth):
        rule = "have a CRS, projected or in degrees, and so must the grid that it is resampled to"
        raise ValueError(f"{name} must {rule}, it has {source.crs}, the grid {grid.crs}")
    west, south, east, north = _project_bounds(name, source, grid.crs)
    left, bottom, right, top = grid.bounds
    if not (west < right and left < east and south < top and bottom < north):
        got = tuple(round(each, 1) for each in (west, south, east, north))
        raise ValueError(f"{name} must overlap the grid {grid.bounds} that it is resampled to, it covers {got}")


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
    with _gdal_errors(f"{name} must be a whole {driver} raster, {path} cannot be read"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver, **options)
        with dataset:
            yield dataset


@contextmanager
def _gdal_errors(rule: str) -> Iterator[None]:
    """Turn what GDAL raises into one line."""
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import CRSError, RasterioError

    try:
        yield
    except (RasterioError, CRSError, CPLE_BaseError, OSError) as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise ValueError(f"{rule}: {reason}") from None
