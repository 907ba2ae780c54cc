"""Resampling of layers onto another grid."""

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warp_torchrl.world.terrain.crs import WGS84, stated_crs
from warp_torchrl.world.terrain.gdal import reading
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import LARGEST_MAP, read_header, read_layer

Method = Literal["nearest", "mode", "bilinear"]
"""How values are put on another grid."""
_UNKNOWN = -(2.0**31)  # the class that stands for nodata while classes are resampled; exact in float32


def resample_layer(
    name: str, path: Path, grid: Grid, method: Method, number: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
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
        number: Of its band, from 1; None finds it as ``read_header`` does.

    Returns:
        float64 and bool, [H, W] of ``grid``.

    Raises:
        ValueError: As ``read_grid`` and ``read_layer``; or if either grid has no CRS, or they do not overlap.
    """
    source = read_header(name, path, metric=False, band=number).grid
    _check_overlap(name, source, grid)
    return resample(name, *read_layer(name, path, number), source, grid, method)


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
    hole = math.nan if method == "bilinear" else _UNKNOWN
    target = np.full(grid.shape, hole)
    nodata = {"src_nodata": hole, "dst_nodata": hole} if method == "bilinear" else {}
    places = {"src_transform": source.transform, "src_crs": source.crs}
    places |= {"dst_transform": grid.transform, "dst_crs": grid.crs}
    values = np.where(known, values, hole).astype(np.float64)
    with reading(f"{name} must be resampled to {grid.crs}, which fails"):
        from rasterio.warp import Resampling, reproject

        reproject(values, target, **places, **nodata, resampling=Resampling[method], init_dest_nodata=False)
    known = ~np.isnan(target) if method == "bilinear" else target != _UNKNOWN
    if not known.any():
        raise ValueError(f"{name} must hold data where it is resampled to, {grid.bounds}, it has none there")
    return target, known


def fill(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values [H, W] with unknown cells interpolated from the known cells around, at most 100 cells off.

    Cells farther off get the mean of all that are known.
    """
    if known.all():
        return values
    with reading("elevation must be interpolated, which fails"):
        from rasterio.fill import fillnodata

        filled = fillnodata(np.where(known, values, math.nan), mask=known, max_search_distance=100.0)
    return np.where(np.isnan(filled), values[known].mean(), filled).astype(values.dtype)


def regrid(name: str, grid: Grid, resolution: float) -> Grid:
    """Return the grid of square cells, whole ones only, that covers another from its north-west corner on.

    A projected grid keeps its CRS where its metres are those of the ground. Others, in degrees or in Web Mercator,
    become grids of the UTM zone of their middle.

    Args:
        name: Whose grid it is, for messages.
        grid: The grid to cover.
        resolution: Side of the new cells [m].

    Raises:
        ValueError: If the grid has no CRS, lies too near a pole for UTM, is too wide for a zone of it, or makes no cell
            or too many.
    """
    if not grid.is_on_earth:
        raise ValueError(f"{name} must have a CRS, projected or in degrees, to be resampled, got {grid.crs}")
    crs = grid.crs if grid.crs.is_projected and not grid.distortion else _find_utm(name, grid)
    west, south, east, north = project_bounds(name, grid, crs)
    side = resolution / crs.linear_units_factor[1]
    sides = [(north - south) / side + 1e-6, (east - west) / side + 1e-6]  # 6 cells are 5.999.. in floating point
    if not all(1 <= each <= LARGEST_MAP for each in sides) or int(sides[0]) * int(sides[1]) > LARGEST_MAP:
        rule = f"give 1 to {LARGEST_MAP} cells on {name}"
        raise ValueError(f"resolution must {rule}, got {resolution:g} m for {sides[0]:.1f} x {sides[1]:.1f} cells")
    place = type(grid.transform)(side, 0.0, west, 0.0, -side, north)
    made = Grid((int(sides[0]), int(sides[1])), crs, place)
    if made.distortion:
        raise ValueError(f"{name} must be put on cells that are true on the ground, in {crs} it has {made.distortion}")
    return made


def _find_utm(name: str, grid: Grid) -> Any:
    """Return the UTM zone of a grid's middle."""
    west, south, east, north = project_bounds(name, grid, stated_crs(name, WGS84))
    longitude, latitude = (west + east) / 2, (south + north) / 2
    if not (-80.0 <= latitude <= 84.0 and -180.0 <= longitude <= 180.0):
        raise ValueError(f"{name} must lie in 80 S to 84 N to be put on a UTM grid, its middle is at {latitude:g}")
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return stated_crs(name, (32600 if latitude >= 0.0 else 32700) + zone)


def project_bounds(name: str, grid: Grid, crs: Any) -> tuple[float, float, float, float]:
    """Return a grid's (west, south, east, north) in another CRS; infinite where it cannot be seen there."""
    if crs == grid.crs:
        return grid.bounds
    with reading(f"{name} must have a CRS that {crs} can be reached from, got {grid.crs}"):
        from rasterio.warp import transform_bounds

        return transform_bounds(grid.crs, crs, *grid.bounds)


def _check_overlap(name: str, source: Grid, grid: Grid) -> None:
    if not (source.is_on_earth and grid.is_on_earth):
        rule = "have a CRS, projected or in degrees, and so must the grid that it is resampled to"
        raise ValueError(f"{name} must {rule}, it has {source.crs}, the grid {grid.crs}")
    west, south, east, north = project_bounds(name, source, grid.crs)
    left, bottom, right, top = grid.bounds
    if not (west < right and left < east and south < top and bottom < north):
        got = tuple(round(each, 1) for each in (west, south, east, north))
        raise ValueError(f"{name} must overlap the grid {grid.bounds} that it is resampled to, it covers {got}")
