"""Small rasters written by hand, for the tests of what reads them."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch

from warp_torchrl.world.arrays.random import world_key

rasterio = pytest.importorskip("rasterio")

LANDFIRE = Path(__file__).parents[3] / "shared" / "landscapes" / "landfire"
FIRES = Path(__file__).parents[3] / "shared" / "fires"
needs_fires = pytest.mark.skipif(not FIRES.is_dir(), reason=f"the fires with an outcome are not at {FIRES}")
needs_landfire = pytest.mark.skipif(not LANDFIRE.is_dir(), reason=f"the LANDFIRE sample is not at {LANDFIRE}")
NODATA = -9999


def write(path, values, dtype="float32", nodata=NODATA, cell=30.0, west=0.0, crs="EPSG:5070", scale=None, **options):
    """Write one band, north up; ``cell=None`` leaves it without a place on Earth."""
    values = np.atleast_3d(np.asarray(values, dtype)).transpose(2, 0, 1)
    count, height, width = values.shape
    if cell is not None:
        options["transform"] = rasterio.Affine(cell, 0.0, west, 0.0, -cell, 5e4)
    profile = {"count": count, "height": height, "width": width, "dtype": dtype, "nodata": nodata, "crs": crs}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", **{**profile, **options}) as layer:
            layer.write(values)
            if scale is not None:
                layer.scales = (scale,)
    return path


def write_ascii(path, rows, nodata=NODATA, columns=None):
    """Write an ESRI ASCII grid of 10 m cells."""
    columns = columns or len(rows[0].split())
    header = f"ncols {columns}\nnrows {len(rows)}\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value {nodata}\n"
    path.write_text(header + "\n".join(rows) + "\n")
    return path


def write_enormous(path, side=400_000):
    """Write a sparse GeoTIFF that declares 149 GiB and takes 100 kB."""
    options = {"width": side, "height": side, "count": 1, "dtype": "uint8", "SPARSE_OK": True}
    tiles = {"tiled": True, "blockxsize": 4096, "blockysize": 4096}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        rasterio.open(path, "w", driver="GTiff", **options, **tiles).close()
    return path


def read(path):
    """Return the numbers of a raster."""
    with rasterio.open(path) as layer:
        return layer.read(1)


def keys(count):
    """Return the keys of the first worlds, episode 0."""
    return world_key(torch.arange(count), torch.zeros(count, dtype=torch.int64))


def refuse(words, call, *arguments, **fields):
    """Check that a call is refused in one line with these words."""
    with pytest.raises(ValueError) as caught:
        call(*arguments, **fields)
    assert re.search(words, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)
