"""Maps as GeoTIFF: named bands, on the landscape's grid."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from warp_torchrl.system import disk
from warp_torchrl.world.terrain.grid import Grid

NO_RASTERIO_TO_WRITE = (
    'GeoTIFF and GeoJSON must be written with rasterio, which is missing: pip install "warp_torchrl[gis]"'
)


def write_geotiff(
    path: Path,
    layers: Mapping[str, Tensor | np.ndarray],
    grid: Grid,
    corner: tuple[int, int] = (0, 0),
    unit: str = "",
) -> None:
    """Write layers as the bands of one GeoTIFF, compressed, whole or not at all.

    Numbers with a fraction are written as float32 with NaN as nodata, truths as uint8 (1 is true), whole numbers as
    they are, int64 as int32. Bands of one file have one type: the narrowest that holds all.

    Args:
        path: The file.
        layers: By the band's name, [rows, columns] each, all of one shape.
        grid: The grid that they lie on, with its CRS and transform.
        corner: (row, column) of the layers' first cell in the grid, for a window of it.
        unit: Of all bands; nothing states none.

    Raises:
        ValueError: If there is no layer, shapes differ or leave the grid, a number does not fit, or rasterio is not
            installed.
        OSError: If the write fails, with the path.
    """
    rasterio = _rasterio()
    bands = {name: _as_band(name, layer) for name, layer in layers.items()}
    check_window(bands, grid, corner)
    dtype = np.result_type(*bands.values())
    height, width = next(iter(bands.values())).shape
    profile = {
        "driver": "GTiff",
        "count": len(bands),
        "height": height,
        "width": width,
        "dtype": dtype.name,
        "nodata": float("nan") if dtype.kind == "f" else None,
        "crs": grid.crs,
        "transform": window_transform(grid, corner),
        "compress": "deflate",
        "interleave": "band",  # bands are written one after the other, so that no copy of all of them is made
    }
    with rasterio.MemoryFile() as memory:  # GDAL tells of a full disk too late to be caught
        with memory.open(**profile) as file:
            for number, (name, band) in enumerate(bands.items(), start=1):
                file.write(band.astype(dtype, copy=False), number)
                file.set_band_description(number, name)
                if unit:
                    file.set_band_unit(number, unit)
        disk.replace(path, bytes(memory.getbuffer()))


def check_window(layers: Mapping[str, np.ndarray], grid: Grid, corner: tuple[int, int]) -> None:
    """Refuse layers that are none, not of one shape [rows, columns], or do not lie in the grid.

    Raises:
        ValueError: With the layer, the rule and the shape.
    """
    if not layers:
        raise ValueError("layers must have at least one layer, got none")
    (row, column), (rows, columns) = corner, grid.shape
    first = next(iter(layers.values()))
    for name, layer in layers.items():
        if layer.ndim != 2 or layer.shape != first.shape:
            raise ValueError(
                f"{name} must be [rows, columns] of one shape, {list(first.shape)}, got {list(layer.shape)}"
            )
    height, width = first.shape
    if not (0 <= row <= rows - height and 0 <= column <= columns - width):
        raise ValueError(
            f"corner must leave room for {height} x {width} cells in the grid of {rows} x {columns}, got {corner}"
        )


def window_transform(grid: Grid, corner: tuple[int, int]) -> Any:
    """Return the transform of a window of a grid, from (column, row) in the window to coordinates."""
    (row, column), (a, b, left, d, e, top) = corner, grid.transform[:6]
    return type(grid.transform)(a, b, left + a * column + b * row, d, e, top + d * column + e * row)


def local_grid(shape: tuple[int, int], cell_size: float) -> Grid:
    """Return a grid without a CRS, in metres from the south-west corner of the map, for ground that has no place.

    Args:
        shape: (rows, columns).
        cell_size: Side of a cell [m].

    Raises:
        ValueError: If rasterio is not installed.
    """
    return Grid(shape, None, _rasterio().Affine(cell_size, 0.0, 0.0, 0.0, -cell_size, shape[0] * cell_size))


def as_array(layer: Tensor | np.ndarray) -> np.ndarray:
    """Return a layer as an array, from any device."""
    return layer.numpy(force=True) if isinstance(layer, Tensor) else np.asarray(layer)


def _as_band(name: str, layer: Tensor | np.ndarray) -> np.ndarray:
    """Return a layer in a type that a GeoTIFF has."""
    values = as_array(layer)
    kind = values.dtype.kind
    if kind not in "bfiu":
        raise ValueError(f"{name} must hold numbers or truths, got {values.dtype}")
    if kind == "f":
        return values.astype(np.float32, copy=False)
    if kind == "b":
        return values.astype(np.uint8)
    if values.dtype.itemsize < 8 and values.dtype != np.int8:
        return values
    limits = np.iinfo(np.int32)
    if values.size and not (limits.min <= values.min() and values.max() <= limits.max):
        raise ValueError(f"{name} must hold whole numbers of 32 bits, got {values.min()}..{values.max()}")
    return values.astype(np.int32)


def _rasterio() -> Any:
    """Return rasterio, an extra of the package.

    Raises:
        ValueError: If it is not installed.
    """
    try:
        import rasterio
    except ImportError:
        raise ValueError(NO_RASTERIO_TO_WRITE) from None
    return rasterio
