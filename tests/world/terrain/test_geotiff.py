"""Maps that a geographic information system opens where they lie."""

import math
import sys

import numpy as np
import pytest
import torch

from tests.world.rasters import rasterio, refuse
from warp_torchrl.world.terrain.geotiff import local_grid, write_geotiff
from warp_torchrl.world.terrain.grid import Grid

ALBERS = Grid((4, 5), rasterio.crs.CRS.from_epsg(5070), rasterio.Affine(30.0, 0.0, 600.0, 0.0, -30.0, 5000.0))


def test_numbers_come_back_with_their_place_their_names_and_their_holes(tmp_path):
    probability = torch.arange(20, dtype=torch.float64).view(4, 5) / 20.0
    probability[1, 2] = math.nan
    hours = np.full((4, 5), 3.0, np.float32)
    write_geotiff(tmp_path / "maps.tif", {"burn_probability": probability, "hours": hours}, ALBERS)
    with rasterio.open(tmp_path / "maps.tif") as file:
        assert (file.dtypes, file.crs, file.transform) == (("float32", "float32"), ALBERS.crs, ALBERS.transform)
        assert file.descriptions == ("burn_probability", "hours") and file.compression.name == "deflate"
        assert math.isnan(file.nodata) and not file.read_masks(1)[1, 2] and file.read_masks(1).sum() == 19 * 255
        assert np.array_equal(file.read(1), probability.numpy().astype(np.float32), equal_nan=True)
        assert (file.read(2) == 3.0).all()
    assert [path.name for path in tmp_path.iterdir()] == ["maps.tif"], "no draft is left"


def test_a_window_lies_where_its_cells_do(tmp_path):
    write_geotiff(tmp_path / "window.tif", {"burned": torch.ones(2, 3, dtype=torch.bool)}, ALBERS, corner=(1, 2))
    with rasterio.open(tmp_path / "window.tif") as file:
        # Two columns east of 600 m and one row south of 5000 m, cells of 30 m.
        assert file.bounds == (660.0, 4910.0, 750.0, 4970.0)
        assert file.dtypes == ("uint8",) and file.nodata is None and (file.read(1) == 1).all()


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("bool", "uint8"),
        ("uint8", "uint8"),
        ("int8", "int32"),
        ("int16", "int16"),
        ("int64", "int32"),
        ("float64", "float32"),
    ],
)
def test_every_type_is_written_in_one_that_a_geotiff_has(tmp_path, given, written):
    write_geotiff(tmp_path / "layer.tif", {"layer": np.ones((4, 5), given)}, ALBERS)
    with rasterio.open(tmp_path / "layer.tif") as file:
        assert file.dtypes == (written,) and (file.read(1) == 1).all()


def test_ground_without_a_place_is_in_metres_from_its_south_west_corner(tmp_path):
    write_geotiff(tmp_path / "layer.tif", {"layer": np.zeros((4, 5))}, local_grid((4, 5), 20.0))
    with rasterio.open(tmp_path / "layer.tif") as file:
        assert file.crs is None and file.bounds == (0.0, 0.0, 100.0, 80.0)


@pytest.mark.parametrize(
    ("words", "layers", "corner"),
    [
        ("layers must have at least one", {}, (0, 0)),
        (r"b must be \[rows, columns\] of one shape, \[4, 5\], got \[4, 4\]", {"a": (4, 5), "b": (4, 4)}, (0, 0)),
        (r"a must be \[rows, columns\]", {"a": (4,)}, (0, 0)),
        (r"corner must leave room for 2 x 3 cells in the grid of 4 x 5, got \(3, 0\)", {"a": (2, 3)}, (3, 0)),
        ("corner must leave room", {"a": (2, 3)}, (0, -1)),
    ],
)
def test_layers_that_do_not_fit_are_refused(tmp_path, words, layers, corner):
    zeros = {name: np.zeros(shape) for name, shape in layers.items()}
    refuse(words, write_geotiff, tmp_path / "layer.tif", zeros, ALBERS, corner)
    assert not list(tmp_path.iterdir())


def test_numbers_that_do_not_fit_are_refused(tmp_path):
    refuse("a must hold whole numbers of 32 bits", write_geotiff, tmp_path / "a", {"a": np.full((4, 5), 2**40)}, ALBERS)
    refuse(
        "a must hold numbers or truths, got complex128", write_geotiff, tmp_path / "a", {"a": np.eye(4) * 1j}, ALBERS
    )


def test_the_old_map_stays_where_the_new_one_fails(tmp_path, monkeypatch):
    write_geotiff(tmp_path / "layer.tif", {"layer": np.zeros((4, 5))}, ALBERS)
    before = (tmp_path / "layer.tif").read_bytes()

    def refused(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", refused)
    with pytest.raises(OSError, match="No space left on device") as error:
        write_geotiff(tmp_path / "layer.tif", {"layer": np.ones((4, 5))}, ALBERS)
    assert error.value.filename == str(tmp_path / "layer.tif") and len(list(tmp_path.iterdir())) == 1
    assert (tmp_path / "layer.tif").read_bytes() == before


def test_what_is_missing_is_told_with_the_extra_that_has_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    refuse(r"warp_torchrl\[gis\]", write_geotiff, tmp_path / "a.tif", {"a": np.zeros((4, 5))}, ALBERS)
