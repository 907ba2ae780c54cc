"""One raster layer: its grid, its values, its values on another grid, and every refusal in one line."""

import math
import re
import sys
import time
import warnings

import numpy as np
import pytest

from tests.world.rasters import NODATA, rasterio, refuse, write, write_ascii, write_enormous
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import find_layer, read_grid, read_layer
from warp_torchrl.world.terrain.resampling import regrid, resample_layer

ALBERS, UTM = "EPSG:5070", "EPSG:32618"
TOP = 5e4  # north edge of what ``write`` makes


def grid_of(rows, columns, cell, west=0.0, north=TOP, crs=ALBERS):
    """Return the grid of square cells, north up."""
    place = rasterio.crs.CRS.from_string(crs) if crs else None
    return Grid((rows, columns), place, rasterio.Affine(cell, 0.0, west, 0.0, -cell, north))


def plane(rows, columns, cell, west=0.0, north=TOP):
    """Return z = 0.2 x + 0.1 (y - TOP) at the middles of the cells."""
    x, y = west + cell * (np.arange(columns) + 0.5), north - TOP - cell * (np.arange(rows) + 0.5)
    return np.add.outer(0.1 * y, 0.2 * x)


# --- The grid


def test_the_grid_comes_from_the_header(tmp_path):
    grid = read_grid("wind", write(tmp_path / "u.tif", np.zeros((4, 6)), west=90.0))
    assert grid == grid_of(4, 6, 30.0, west=90.0) and grid.is_metric
    assert grid.shape == (4, 6) and grid.bounds == (90.0, TOP - 120.0, 270.0, TOP) and grid.cell_size == 30.0


@pytest.mark.parametrize("cell, crs, expected", [(None, None, 30.0), (25.0, None, 25.0), (100.0, "EPSG:2264", 30.4801)])
def test_the_cell_size_is_in_metres(tmp_path, cell, crs, expected):
    grid = read_grid("wind", write(tmp_path / "u.tif", np.zeros((4, 6)), cell=cell, crs=crs))
    assert grid.cell_size == pytest.approx(expected, abs=1e-4)  # EPSG:2264 is in US survey feet


@pytest.mark.parametrize(
    "other, what",
    [
        (grid_of(4, 6, 30.0), None),
        (grid_of(4, 6, 30.0, west=0.29), None),  # a hundredth of a cell is let pass
        (grid_of(4, 6, 30.0, west=0.31), "bounds"),
        (grid_of(4, 6, 30.1), "bounds"),
        (
            grid_of(4, 6, 30.0)._replace(transform=rasterio.Affine(30.0, 0.0, 0.0, 0.0, 30.0, TOP - 120.0)),
            "corners",
        ),  # south-up
        (
            grid_of(4, 6, 30.0)._replace(transform=rasterio.Affine(-30.0, 0.0, 180.0, 0.0, -30.0, TOP)),
            "corners",
        ),  # from the east
        (grid_of(4, 7, 30.0), "shape"),
        (grid_of(4, 6, 30.0, crs=UTM), "CRS"),
        (grid_of(4, 6, 30.0, crs=None), "CRS"),
    ],
)
def test_grids_that_differ_are_refused_with_what_differs(other, what):
    if what is None:
        check_grid("wind", other, "fuel", grid_of(4, 6, 30.0))
    else:
        refuse(f"^wind must have the {what} of fuel, .*, got ", check_grid, "wind", other, "fuel", grid_of(4, 6, 30.0))


def test_a_layer_is_named_by_its_file_or_by_a_pattern(tmp_path):
    for name in ("a_Elev.tif", "a_Elev.tif.aux.xml", "a_Elev.prj", "b_F13.ASC"):
        (tmp_path / name).touch()
    assert find_layer("elevation", tmp_path, "*Elev*") == find_layer("elevation", tmp_path, "a_Elev.tif")
    assert find_layer("fuel", tmp_path, "*F13*").name == "b_F13.ASC"
    assert find_layer("fuel", tmp_path, str(tmp_path / "b_F13.ASC")).name == "b_F13.ASC"
    refuse("^fuel must name one file in .* matches 2: a_Elev.tif, b_F13.ASC", find_layer, "fuel", tmp_path, "*")
    refuse("^fuel must name one file in .* matches 0: none", find_layer, "fuel", tmp_path, "*F40*")
    refuse("^fuel must name one file in .* does not: File name too long", find_layer, "fuel", tmp_path, "x" * 300)


# --- The values


def test_values_are_scaled_as_the_file_says_and_nodata_is_not_known(tmp_path):
    path = write(tmp_path / "z.tif", [[1234, NODATA], [10, 0]], "int16", scale=0.1)
    values, known = read_layer("elevation", path)
    assert known.tolist() == [[True, False], [True, True]]
    np.testing.assert_allclose(values[known], [123.4, 1.0, 0.0])


def test_text_grids_keep_their_decimals(tmp_path):
    # The first decimal comes late: left to itself, GDAL would take the grid for whole numbers.
    path = write_ascii(tmp_path / "z.asc", ["100 200 300 400"] * 3 + ["100 -9999 300 400.5"])
    values, known = read_layer("elevation", path)
    assert values[3].tolist() == [100.0, NODATA, 300.0, 400.5] and known.sum() == 15
    assert read_grid("elevation", path).cell_size == 10.0


@pytest.mark.parametrize("line, is_read", [("12,5", False), ("10,0", True), ("1.25e1", True)])
def test_decimal_commas_of_a_header_are_not_cut_off(tmp_path, line, is_read):
    path = write_ascii(tmp_path / "z.asc", ["1 2"] * 2)
    path.write_text(path.read_text().replace("cellsize 10", f"cellsize {line}"))
    if is_read:
        assert read_grid("fuel", path).cell_size == float(line.replace(",", "."))
    else:
        refuse("^fuel must have decimal points in its header, .* has 'cellsize 12,5'", read_grid, "fuel", path)


# --- The values on another grid


@pytest.fixture
def classes(tmp_path):
    """4 x 4 classes of 30 m; X is nodata.

    1 1 | 2 3
    1 2 | 3 3
    ----+----
    8 8 | X X
    8 7 | X 5
    """
    rows = [[1, 1, 2, 3], [1, 2, 3, 3], [8, 8, NODATA, NODATA], [8, 7, NODATA, 5]]
    return write(tmp_path / "fuel.tif", rows, "int16")


def test_mode_takes_what_most_cells_have_nodata_being_a_class(classes):
    values, known = resample_layer("fuel", classes, grid_of(2, 2, 60.0), "mode")
    assert known.tolist() == [[True, True], [True, False]]
    assert values[known].tolist() == [1.0, 3.0, 8.0]


def test_nearest_takes_the_cell_that_the_middle_lies_in(classes):
    # Middles of 40 m cells lie at 20, 60, 100 m: in cells 0, 2 (60 m is its west edge) and 3.
    values, known = resample_layer("fuel", classes, grid_of(3, 3, 40.0), "nearest")
    assert values[known].tolist() == [1.0, 2.0, 3.0, 8.0, 8.0, 5.0]
    assert known.tolist() == [[True, True, True], [True, False, False], [True, False, True]]
    finer, known = resample_layer("fuel", classes, grid_of(8, 8, 15.0), "nearest")
    values, whole = read_layer("fuel", classes)
    np.testing.assert_array_equal(known, whole.repeat(2, 0).repeat(2, 1))
    np.testing.assert_array_equal(finer[known], values.repeat(2, 0).repeat(2, 1)[known])


def test_no_method_makes_values_off_the_layer(classes):
    # 6 x 6 cells that begin two cells (60 m) west and north of the layer: it lies in rows and columns 2..5.
    for method in ("nearest", "mode", "bilinear"):
        _, known = resample_layer("fuel", classes, grid_of(6, 6, 30.0, west=-60.0, north=TOP + 60.0), method)
        assert not known[:2].any() and not known[:, :2].any()
        np.testing.assert_array_equal(known[2:, 2:], read_layer("fuel", classes)[1])


def test_bilinear_by_hand(tmp_path):
    # Middles of the old cells at 15 and 45 m, of the new ones at 5, 15, 25, 35, 45, 55: weights 1/3 and 2/3 between.
    path = write(tmp_path / "z.tif", [[0.0, 90.0]] * 2)
    values, known = resample_layer("elevation", path, grid_of(6, 6, 10.0), "bilinear")
    assert known.all()
    np.testing.assert_allclose(values, np.tile([0.0, 0.0, 30.0, 60.0, 90.0, 90.0], (6, 1)), atol=1e-4)


@pytest.mark.parametrize("cell, west, north", [(15.0, 60.0, TOP - 60.0), (60.0, 60.0, TOP - 60.0), (30.0, 71.0, 49917)])
def test_a_plane_stays_a_plane_in_bilinear(tmp_path, cell, west, north):
    # Away from the edge of the layer; there the weights are those of what is left.
    path = write(tmp_path / "z.tif", plane(16, 16, 30.0), "float64", nodata=None)
    values, known = resample_layer("elevation", path, grid_of(5, 5, cell, west, north), "bilinear")
    assert known.all()
    np.testing.assert_allclose(values, plane(5, 5, cell, west, north), atol=1e-9)


def test_cells_larger_by_a_fraction_are_off_a_plane_by_little(tmp_path):
    # GDAL's weights, a triangle as wide as the larger cells, sum to 1 but do not balance there: 3 % of a cell's rise.
    path = write(tmp_path / "z.tif", plane(24, 24, 20.0), "float64", nodata=None, cell=20.0)
    values, _ = resample_layer("elevation", path, grid_of(8, 8, 30.0, 90.0, TOP - 90.0), "bilinear")
    assert np.abs(values - plane(8, 8, 30.0, 90.0, TOP - 90.0)).max() < 0.03 * 20.0 * (0.2 + 0.1)


def test_bilinear_is_of_known_cells_and_leaves_nodata_unknown(tmp_path):
    # Cell (1, 1) is nodata, -9999: no new value may come near it, and just the four new cells in it are unknown.
    heights = np.full((4, 4), 50.0)
    heights[1, 1] = NODATA
    path = write(tmp_path / "z.tif", heights)
    values, known = resample_layer("elevation", path, grid_of(8, 8, 15.0), "bilinear")
    np.testing.assert_array_equal(known, (heights > 0).repeat(2, 0).repeat(2, 1))
    np.testing.assert_allclose(values[known], 50.0)


def test_a_layer_in_degrees_is_put_on_a_grid_in_metres(tmp_path):
    # z = 1000 x latitude, 0.001 degrees (111 m) a cell; the new grid's middles are projected back by PROJ.
    latitude = 44.5 - 0.001 * (np.arange(100) + 0.5)
    place = rasterio.Affine(0.001, 0.0, -72.6, 0.0, -0.001, 44.5)
    heights = np.tile(1000.0 * latitude[:, None], (1, 100))
    path = write(tmp_path / "z.tif", heights, "float64", cell=None, crs="EPSG:4326", transform=place)
    grid = regrid("elevation", read_grid("elevation", path, metric=False), 200.0)
    assert grid.crs.to_epsg() == 32618 and grid.cell_size == 200.0 and grid.is_metric  # zone 18: 78 to 72 W
    values, known = resample_layer("elevation", path, grid, "bilinear")
    from rasterio.warp import transform

    row, column = np.nonzero(known)
    x, y = grid.bounds[0] + 200.0 * (column + 0.5), grid.bounds[3] - 200.0 * (row + 0.5)
    _, wanted = transform(grid.crs, "EPSG:4326", x, y)
    inside = (np.array(wanted) < 44.497) & (np.array(wanted) > 44.403)
    np.testing.assert_allclose(values[known][inside], 1000.0 * np.array(wanted)[inside], atol=0.2)
    assert known.mean() > 0.9


@pytest.mark.parametrize("cell, resolution, crs, shape", [(30, 60, ALBERS, (5, 6)), (30, 10.0, ALBERS, (33, 39))])
def test_a_new_grid_has_whole_cells_from_the_north_west_corner(cell, resolution, crs, shape):
    # 11 x 13 cells of 30 m are 330 x 390 m: 5.5 x 6.5 cells of 60 m, 33 x 39 of 10 m.
    grid = regrid("fuel", grid_of(11, 13, cell, west=70.0, crs=crs), resolution)
    assert grid.shape == shape and grid.cell_size == resolution
    assert (grid.bounds[0], grid.bounds[3]) == (70.0, TOP) and grid.crs == rasterio.crs.CRS.from_string(crs)


def test_the_resolution_is_in_metres_where_the_crs_is_in_feet():
    feet = 1200.0 / 3937.0  # a US survey foot
    grid = regrid("fuel", grid_of(10, 10, 100.0, crs="EPSG:2264"), 20.0 * 10 * feet)
    assert grid.shape == (5, 5) and grid.cell_size == pytest.approx(200.0 * feet)


@pytest.mark.parametrize("west, zone", [(-72.6, 32618), (2.0, 32631), (179.5, 32660), (-180.0, 32601)])
def test_degrees_go_to_the_zone_of_their_middle(west, zone):
    grid = Grid((10, 10), rasterio.crs.CRS.from_epsg(4326), rasterio.Affine(0.01, 0, west, 0, -0.01, 44.5))
    assert regrid("fuel", grid, 30.0).crs.to_epsg() == zone
    south = Grid(grid.shape, grid.crs, rasterio.Affine(0.01, 0, west, 0, -0.01, -33.0))
    assert regrid("fuel", south, 30.0).crs.to_epsg() == zone + 100


def test_grids_that_cannot_be_made_are_refused():
    refuse("^resolution must give 1 to 100000000 cells on fuel, got 0.01 m for 30000", regrid, "fuel", GRID, 0.01)
    refuse("^resolution must give 1 to .*, got 1000 m for 0.3 x 0.3 cells", regrid, "fuel", GRID, 1000.0)
    refuse("^fuel must have a CRS, projected or in degrees", regrid, "fuel", grid_of(4, 4, 30.0, crs=None), 60.0)
    degrees = rasterio.crs.CRS.from_epsg(4326)
    pole = Grid((10, 10), degrees, rasterio.Affine(0.01, 0, 0.0, 0, -0.01, 89.0))
    refuse("^fuel must lie in 80 S to 84 N to be put on a UTM grid, its middle is at 88.95", regrid, "fuel", pole, 30.0)
    nowhere = Grid((10, 10), degrees, rasterio.Affine(1.0, 0, 500.0, 0, -1.0, 200.0))
    refuse("^fuel must", regrid, "fuel", nowhere, 30.0)


def test_layers_that_cannot_be_resampled_are_refused(tmp_path, capfd):
    path, grid = write(tmp_path / "z.tif", np.zeros((4, 4))), grid_of(4, 4, 20.0)
    for far in (grid_of(4, 4, 20.0, west=120.0), grid_of(4, 4, 20.0, north=TOP - 120.0), grid_of(4, 4, 20.0, crs=UTM)):
        refuse("^wind must overlap the grid .* covers", resample_layer, "wind", path, far, "bilinear")
    placeless = write(tmp_path / "placeless.tif", np.zeros((4, 4)), crs=None)
    refuse("^wind must have a CRS, .* has None", resample_layer, "wind", placeless, grid, "nearest")
    unknown = grid_of(4, 4, 20.0, crs=None)
    refuse("^wind must have a CRS, .* the grid None", resample_layer, "wind", path, unknown, "nearest")
    local = 'LOCAL_CS["a plan of our own",UNIT["metre",1]]'
    plan = write(tmp_path / "plan.tif", np.zeros((4, 4)), crs=local)
    refuse("^wind must have a CRS, .* has .*plan of our own", resample_layer, "wind", plan, grid, "nearest")
    hole = np.zeros((8, 8))
    hole[:4, :4] = NODATA
    path = write(tmp_path / "hole.tif", hole)
    refuse("^wind must hold data where it is resampled to", resample_layer, "wind", path, grid_of(2, 2, 60.0), "mode")
    assert capfd.readouterr() == ("", "")


# --- Refusals: files


def test_a_truncated_file_is_refused_wherever_it_is_cut(tmp_path, capfd):
    path = write(tmp_path / "z.tif", np.arange(192.0).reshape(12, 16))
    whole = path.read_bytes()
    for length in (0, 3, 8, 100, 200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        refuse(r"^elevation must be a whole GTiff raster, .*z\.tif cannot be read", read_whole, path)
    assert capfd.readouterr() == ("", "")


def read_whole(path):
    read_grid("elevation", path)
    return read_layer("elevation", path)


def test_files_of_another_format_are_refused_whatever_their_name(tmp_path):
    from PIL import Image

    Image.new("L", (16, 12)).save(tmp_path / "picture.png")
    refuse("^elevation must be a GeoTIFF", read_grid, "elevation", tmp_path / "picture.png")
    for name, driver in (("picture.tif", "GTiff"), ("picture.asc", "AAIGrid")):
        (tmp_path / name).write_bytes((tmp_path / "picture.png").read_bytes())
        refuse(f"^elevation must be a whole {driver} raster", read_grid, "elevation", tmp_path / name)
    for name in ("text.tif", "text.asc"):
        (tmp_path / name).write_text("grass and trees\n" * 20)
        refuse("^elevation must be a whole", read_grid, "elevation", tmp_path / name)
    (tmp_path / "folder.tif").mkdir()
    refuse("^elevation must be a whole GTiff", read_grid, "elevation", tmp_path / "folder.tif")
    refuse("^elevation must be a whole GTiff", read_grid, "elevation", tmp_path / "missing.tif")


@pytest.mark.parametrize(
    "rows, columns, words",
    [
        (["1 2 3 4"] * 3 + ["1 2"], 4, "whole AAIGrid raster"),
        (["1 2 3 4"] * 3 + ["1 2 three 4"], 4, "must hold 16 numbers after its header, .* holds 15"),
        (["1 2 3 4 5"] * 4, 4, "must hold 16 numbers after its header, .* holds 20"),
        (["-9999 -9999 -9999 -9999"] * 4, 4, "must hold data, .*all nodata"),
    ],
)
def test_text_grids_that_are_not_what_they_declare_are_refused(tmp_path, rows, columns, words):
    refuse(words, read_whole, write_ascii(tmp_path / "z.asc", rows, columns=columns))


@pytest.mark.parametrize("cell", ["0", "-10", "nan", "0.0002778", "1e7"])
def test_text_grids_of_impossible_cells_are_refused(tmp_path, cell):
    # 0.0002778 is a second of arc, in a grid that does not say so
    path = write_ascii(tmp_path / "z.asc", ["1 2 3 4"] * 4)
    path.write_text(path.read_text().replace("cellsize 10", f"cellsize {cell}"))
    refuse("^elevation must", read_whole, path)


def test_enormous_rasters_are_refused_from_their_header(tmp_path):
    # 400 000 x 400 000 bytes are 149 GiB; the sparse file takes 100 kB
    tif = write_enormous(tmp_path / "z.tif")
    text = write_ascii(tmp_path / "z.asc", ["1 2"], columns=400_000)
    text.write_text(text.read_text().replace("nrows 1", "nrows 400000"))
    start = time.perf_counter()
    for path in (tif, text):
        words = "^elevation must have at most 100000000 cells, .* declares 400000 x 400000"
        refuse(words, read_grid, "elevation", path)
        refuse(words, resample_layer, "elevation", path, grid_of(4, 4, 20.0), "mode")
    assert time.perf_counter() - start < 2.0


@pytest.mark.parametrize(
    "values, options, words",
    [
        (np.full((4, 4), NODATA), {}, "must hold data, .*all nodata"),
        (np.full((4, 4), np.nan), {"nodata": math.nan}, "must hold data, .*all nodata"),
        (np.zeros((4, 4, 2)), {}, "must have one band of real numbers, .* has 1 .float32., 2 .float32.; write the one"),
        (np.zeros((4, 4)), {"dtype": "complex64", "nodata": None}, "must have one band of real numbers, .* complex64"),
        (np.zeros((4, 4)), {"crs": "EPSG:4326"}, "must have square cells .*EPSG:4326; give resample to"),
        (np.zeros((4, 4)), {"crs": None, "cell": 3e-4}, "must have square cells .* in no CRS$"),
        (np.zeros((4, 4)), {"transform": (30, 0, 0, 0, 30, 0)}, "must have square cells in metres, north up"),
        (np.zeros((4, 4)), {"transform": (30, 0, 0, 0, -20, 0)}, r"must have square cells .* has \(30.0, 20.0\)"),
        (np.zeros((4, 4)), {"transform": (30, 9, 0, 9, -30, 0)}, "must have square cells in metres, north up"),
        (np.zeros((4, 4)), {"transform": (30, 0, 0, 9, -30, 0)}, "must have square cells in metres, north up"),
        (np.zeros((4, 4)), {"cell": 2e5}, "must have square cells in metres, north up"),
    ],
)
def test_layers_that_are_not_one_band_of_square_cells_are_refused(tmp_path, values, options, words):
    if "transform" in options:
        options = {"cell": None, "transform": rasterio.Affine(*options["transform"])}
    refuse(f"^elevation {words}", read_whole, write(tmp_path / "z.tif", values, **options))


def test_what_is_to_be_resampled_need_not_have_square_cells_in_metres(tmp_path):
    place = rasterio.Affine(30.0, 0.0, 0.0, 0.0, 20.0, TOP - 80.0)  # rows run north
    path = write(tmp_path / "z.tif", [[row] * 4 for row in (1, 2, 3, 4)], cell=None, transform=place)
    values, known = resample_layer("elevation", path, grid_of(8, 12, 10.0), "nearest")
    assert known.all() and values[:, 0].tolist() == [4, 4, 3, 3, 2, 2, 1, 1]


def test_rasterio_missing_says_what_to_install(tmp_path, monkeypatch):
    path = write(tmp_path / "z.tif", np.zeros((4, 4)))
    monkeypatch.setitem(sys.modules, "rasterio", None)
    refuse(re.escape('pip install "warp_torchrl[gis]"'), read_grid, "elevation", path)


def test_nothing_is_said_about_rasters_without_a_place(tmp_path, capfd):
    path = write(tmp_path / "z.tif", np.zeros((4, 4)), cell=None, crs=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_whole(path)
    assert capfd.readouterr() == ("", "")


GRID = grid_of(10, 10, 30.0)
