"""Raster landscapes: the window that a world gets, the covers of its codes, and every refusal in one line."""

import re
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from warp_torchrl.world.landscape import holds_trees
from warp_torchrl.world.random import world_key
from warp_torchrl.world.raster import Raster
from warp_torchrl.world.state import Cover

rasterio = pytest.importorskip("rasterio")

LANDFIRE = Path(__file__).parents[3] / "shared" / "landscapes" / "landfire"
needs_landfire = pytest.mark.skipif(not LANDFIRE.is_dir(), reason=f"the LANDFIRE sample is not at {LANDFIRE}")
NODATA = -9999


def write(path, values, dtype="float32", nodata=NODATA, cell=30.0, west=0.0, crs="EPSG:5070", scale=None, **options):
    """Write one band, north up; ``cell=None`` leaves it without a place on Earth."""
    values = np.atleast_3d(np.asarray(values, dtype)).transpose(2, 0, 1)
    count, height, width = values.shape
    if cell is not None:
        options["transform"] = rasterio.Affine(cell, 0.0, west, 0.0, -cell, 5e4)
    profile = {
        "count": count,
        "height": height,
        "width": width,
        "dtype": dtype,
        "nodata": nodata,
        "crs": crs,
        **options,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", **profile) as layer:
            layer.write(values)
            if scale is not None:
                layer.scales = (scale,)
    return path


def write_ascii(path, rows, nodata=NODATA, columns=None):
    columns = columns or len(rows[0].split())
    header = f"ncols {columns}\nnrows {len(rows)}\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value {nodata}\n"
    path.write_text(header + "\n".join(rows) + "\n")
    return path


def keys(count):
    return world_key(torch.arange(count), torch.zeros(count, dtype=torch.int64))


def read(path):
    with rasterio.open(path) as layer:
        return layer.read(1)


def refuse(words, **fields):
    """Check that a source is refused in one line with these words."""
    with pytest.raises(ValueError, match=words) as caught:
        Raster(**fields)
    assert "\n" not in str(caught.value)


@pytest.fixture
def folder(tmp_path):
    """A map of 12 x 16 forest cells with nodata in two corners, one in each layer, and a slope of 1 m a cell."""
    fuel = np.full((12, 16), 8)
    fuel[:3, :3] = NODATA
    heights = np.add.outer(np.arange(12.0), np.arange(16.0))
    heights[9:, 13:] = NODATA
    write(tmp_path / "map_F13.tif", fuel, "int16")
    write(tmp_path / "map_Elev.tif", heights)
    return tmp_path


# --- What a world gets


def test_fixed_window_is_the_pixels_of_the_files(folder):
    land = Raster(path=folder, size=(4, 6), row=5, column=2)(keys(3))
    assert land.cover.shape == (3, 4, 6) and land.cover.dtype == torch.uint8
    assert land.elevation.dtype == torch.float32
    expected = torch.from_numpy(read(folder / "map_Elev.tif")[5:9, 2:8])
    assert all(torch.equal(each, expected) for each in land.elevation)
    assert (land.cover == Cover.FOREST).all()


@needs_landfire
def test_fixed_window_of_a_real_map_is_its_pixels():
    land = Raster(path=str(LANDFIRE), row=300, column=250)(keys(1))
    elevation = read(LANDFIRE / "LC20_Elev_220.tif")[300:364, 250:314]
    water = read(LANDFIRE / "LC22_F13_230.tif")[300:364, 250:314] == 98
    np.testing.assert_array_equal(land.elevation[0].numpy(), elevation)
    np.testing.assert_array_equal(land.cover[0].numpy() == Cover.LAKE, water)


@needs_landfire
def test_real_map_has_its_cell_size_and_much_forest():
    source = Raster(path=LANDFIRE)
    land = source(keys(64))
    assert source.cell_size == 30.0 and source.size == 64
    # The whole map is 83.5 % forest, 14.1 % grassland, 0.5 % lake and 1.9 % bare.
    assert 0.7 < (land.cover == Cover.FOREST).float().mean() < 0.95
    assert land.elevation.min() >= 201.0 and land.elevation.max() <= 1101.0


@needs_landfire
def test_random_windows_of_a_real_map_hold_no_nodata_and_enough_fuel():
    source = Raster(path=LANDFIRE, size=(40, 70), min_fuel=0.9)
    land = source(keys(100))
    assert land.elevation.min() >= 201.0  # the map's lowest cell; nodata would be 0
    assert holds_trees(land.cover).float().mean((1, 2)).min() >= 0.9
    # 100 draws out of more than 1e5 windows: hardly two are the same
    assert len(torch.unique(land.elevation.flatten(1), dim=0)) > 95


def test_random_windows_avoid_nodata_of_both_layers_and_reach_every_other_place(folder):
    land = Raster(path=folder, size=8)(keys(500))
    # elevation = row + column, so the top left cell tells row + column, and the two together the place
    assert (land.cover == Cover.FOREST).all()
    # 8 x 8 windows start in rows 0..4, columns 0..8, 45 places. Those that start in rows and columns 0..2 touch the
    # first corner (9 places); those that end in rows >= 9 and columns >= 13, i.e. start in rows 2..4 and columns 6..8,
    # the second (9). 27 remain.
    heights = read(folder / "map_Elev.tif")
    places = [(r, c) for r in range(5) for c in range(9) if not (r < 3 and c < 3) and not (r > 1 and c > 5)]
    assert len(places) == 27
    seen = torch.unique(land.elevation[:, 0, 0])
    assert seen.tolist() == sorted({float(heights[place]) for place in places})


def test_windows_are_drawn_evenly(tmp_path):
    # 4 windows of 4 x 4 in a 4 x 7 strip; its elevation is the column, so the corner tells the window
    write(tmp_path / "F13.tif", np.full((4, 7), 8))
    write(tmp_path / "Elev.tif", np.tile(np.arange(7.0), (4, 1)))
    corner = Raster(path=tmp_path, size=4)(keys(1000)).elevation[:, 0, 0]
    counts = torch.bincount(corner.long(), minlength=4)
    # 250 each; standard deviation sqrt(1000 * 1/4 * 3/4) = 14
    assert len(counts) == 4 and (counts - 250).abs().max() < 4 * 14


def test_a_world_depends_on_its_key_alone(folder):
    source, key = Raster(path=folder, size=6), keys(64)
    batch = source(key)
    for place in (0, 1, 17, 63):
        alone = source(key[place : place + 1])
        for layer in ("cover", "age", "elevation"):
            assert torch.equal(getattr(alone, layer)[0], getattr(batch, layer)[place])
    assert torch.equal(source(key.flip(0)).elevation, batch.elevation.flip(0))
    assert torch.equal(Raster(path=folder, size=6)(key).elevation, batch.elevation)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_a_world_is_the_same_on_every_device(folder):
    source, key = Raster(path=folder, size=6), keys(64)
    here, there = source(key), source(key.cuda())
    for layer in ("cover", "age", "elevation"):
        assert torch.equal(getattr(here, layer), getattr(there, layer).cpu())


def test_fbfm13_codes_become_our_covers(tmp_path):
    write(tmp_path / "F13.tif", [[1, 2, 3, 93], [4, 5, 6, 7], [8, 9, 10, 98], [11, 12, 13, 98], [91, 92, 99, 98]])
    land = Raster(path=tmp_path, elevation=None, size=(5, 4), row=0, column=0)(keys(1))
    drawn = ["GGGG", "GGGG", "FFFL", "FFFL", "BBBL"]
    letters = {Cover.LAKE: "L", Cover.WETLAND: "W", Cover.GRASSLAND: "G", Cover.FOREST: "F", Cover.BARE: "B"}
    assert ["".join(letters[code] for code in row) for row in land.cover[0].tolist()] == drawn
    assert land.elevation is None
    assert (land.age[~holds_trees(land.cover)] == 0).all() and land.age[holds_trees(land.cover)].any()


@pytest.mark.parametrize("table", [{10: "forest", 80: "LAKE"}, {10: 3, 80: Cover.LAKE}, {"10": "Forest", "80": 0}])
def test_a_table_of_ones_own(tmp_path, table):
    codes = np.full((4, 4), 10)
    codes[0, 0] = 80
    path = write(tmp_path / "worldcover.tif", codes, "uint8", nodata=0)
    cover = Raster(path=path, elevation=None, table=table, size=4)(keys(1)).cover[0]
    assert cover[0, 0] == Cover.LAKE and (cover == Cover.FOREST).sum() == 15


def test_windows_keep_to_places_with_fuel(tmp_path):
    codes = np.full((8, 40), 98)
    codes[:, 30:] = 8
    path = write(tmp_path / "fuel.tif", codes)
    cover = Raster(path=path, elevation=None, size=8, min_fuel=0.75)(keys(200)).cover
    share = (cover == Cover.FOREST).float().mean((1, 2))
    assert torch.unique(share).tolist() == [0.75, 0.875, 1.0]
    anywhere = Raster(path=path, elevation=None, size=8, min_fuel=0.0)(keys(200)).cover
    # At least one cell of fuel: the leftmost windows start at column 23 and have one column in eight.
    assert torch.unique((anywhere == Cover.FOREST).float().mean((1, 2))).tolist() == [k / 8 for k in range(1, 9)]


def test_ascii_grids_are_read_and_sidecars_passed_over(tmp_path):
    # The first decimal comes late: left to itself, GDAL would take the grid for whole numbers.
    rows = ["100 200 300 400"] * 3 + ["100 200 300 400.5"]
    write_ascii(tmp_path / "my_Elev.asc", rows)
    write_ascii(tmp_path / "my_F13.ASC", ["8 8 8 98"] * 4)
    (tmp_path / "my_F13.ASC.aux.xml").write_text("<PAMDataset/>")
    source = Raster(path=tmp_path, size=4)
    assert source.cell_size == 10.0
    assert source(keys(1)).elevation[0, 3].tolist() == [100.0, 200.0, 300.0, 400.5]


@pytest.mark.parametrize(
    "cell, crs, expected", [(None, None, 30.0), (25.0, None, 25.0), (100.0, "EPSG:2264", 30.48006)]
)
def test_cell_size_comes_from_the_transform_in_metres(tmp_path, cell, crs, expected):
    path = write(tmp_path / "fuel.tif", np.full((4, 4), 8), cell=cell, crs=crs)  # EPSG:2264 is in US survey feet
    assert Raster(path=path, elevation=None, size=4).cell_size == pytest.approx(expected)


def test_elevation_is_scaled_as_its_file_says(tmp_path):
    fuel = write(tmp_path / "fuel.tif", np.full((4, 4), 8))
    write(tmp_path / "Elev.tif", np.full((4, 4), 1234), "int16", scale=0.1)
    assert Raster(path=fuel, size=4)(keys(1)).elevation[0, 0, 0] == pytest.approx(123.4)


def test_nodata_may_be_nan_and_a_layer_may_have_a_path_of_its_own(tmp_path):
    (tmp_path / "heights").mkdir()
    heights = np.zeros((4, 5))
    heights[0, 0] = np.nan
    elevation = write(tmp_path / "heights" / "dem.tif", heights, nodata=np.nan)
    fuel = write(tmp_path / "fuel.tif", np.full((4, 5), 8))
    source = Raster(path=fuel, elevation=str(elevation), size=4)
    assert torch.isfinite(source(keys(20)).elevation).all()
    refuse("nodata", path=fuel, elevation=str(elevation), size=4, row=0, column=0)


def test_nothing_is_said_about_rasters_without_a_place(tmp_path, capfd):
    path = write(tmp_path / "fuel.tif", np.full((4, 4), 8), cell=None, crs=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Raster(path=path, elevation=None, size=4)
    assert capfd.readouterr() == ("", "")


def test_configuration_is_what_shows_and_compares(folder):
    source = Raster(path=str(folder), size=6)
    assert source == Raster(path=str(folder), size=6) != replace(source, min_fuel=0.25)
    assert "tensor" not in repr(source) and "min_fuel=0.5" in repr(source)


# --- Refusals: fields of the configuration


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"path": None}, "path must name .*None"),
        ({"path": ""}, "path must name"),
        ({"path": 7}, "path must name .*7"),
        ({"path": "/no/such/place"}, "path must name .*/no/such/place"),
        ({"size": 13}, "size must fit in the raster of 12 x 16 cells, got 13 x 13"),
        ({"size": 3}, "size must"),
        ({"size": 11}, "size must leave .* 11 x 11 cells without nodata"),
        ({"min_fuel": 1.5}, "min_fuel must be in .*1.5"),
        ({"min_fuel": float("nan")}, "min_fuel must be in .*nan"),
        ({"row": 5}, "column must be whole"),
        ({"column": 5}, "row must be whole"),
        ({"row": 5, "column": 11}, r"column must be whole, in 0\.\.10"),
        ({"row": -1, "column": 5}, r"row must be whole, in 0\.\.6 .*got -1"),
        ({"row": 1.5, "column": 5}, "row must be whole"),
        ({"row": 2, "column": 2}, "row, column must name a window without nodata, got 2, 2"),
        ({"row": 6, "column": 9}, "row, column must name a window without nodata, got 6, 9"),
        ({"table": "fbfm12"}, "table must be one of fbfm13, .*got fbfm12"),
        ({"table": None}, "table must be"),
        ({"table": {8: "jungle"}}, "table must be .*grassland.*jungle"),
        ({"table": {8: 5}}, "table must be"),
        ({"table": {8.5: 3}}, "table must be .*whole codes"),
        ({"table": {1: 2, 9: 3}}, "table must have every code of fuel, it lacks 1: 8"),
        ({"fuel": "*F40*"}, r"fuel must name one file .*F40.* matches 0: none"),
        ({"fuel": "*.tif"}, "fuel must name one file .*matches 2: map_Elev.tif, map_F13.tif"),
        ({"fuel": None}, "fuel must name one file"),
        ({"elevation": "*height*"}, "elevation must name one file .*matches 0"),
        ({"elevation": "*map*"}, "elevation must name one file .*matches 2"),
        ({"elevation": ""}, "elevation must name one file"),
    ],
)
def test_bad_fields_are_refused_in_one_line(folder, fields, words):
    refuse(words, **{"path": folder, "size": 6, **fields})


def test_min_fuel_that_no_window_has_is_refused(tmp_path):
    codes = np.full((6, 6), 98)
    codes[:, 0] = 8
    path = write(tmp_path / "fuel.tif", codes)
    refuse("min_fuel 0.5", path=path, elevation=None, size=4)


def test_rasterio_missing_says_what_to_install(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    refuse(re.escape('pip install "warp_torchrl[gis]"'), path=folder, size=6)


# --- Refusals: files


def test_a_truncated_file_is_refused_wherever_it_is_cut(folder, capfd):
    elevation = folder / "map_Elev.tif"
    whole = elevation.read_bytes()
    for length in (0, 3, 8, 100, 200, len(whole) // 2, len(whole) - 1):
        elevation.write_bytes(whole[:length])
        refuse("^elevation must be a whole GTiff raster, .*map_Elev.tif", path=folder, size=6)
    assert capfd.readouterr() == ("", "")


def test_other_formats_are_refused_whatever_their_name(folder):
    from PIL import Image

    Image.new("L", (16, 12)).save(folder / "picture.png")
    refuse("fuel must be a GeoTIFF", path=folder / "picture.png", elevation=None)
    (folder / "picture.png").rename(folder / "picture.tif")
    refuse("fuel must be a whole GTiff raster", path=folder / "picture.tif", elevation=None)
    (folder / "picture.tif").rename(folder / "picture.asc")
    refuse("fuel must be a whole AAIGrid raster", path=folder / "picture.asc", elevation=None)


@pytest.mark.parametrize(
    "rows, columns, words",
    [
        (["1 2 3 4"] * 3 + ["1 2"], 4, "whole AAIGrid raster"),
        (["1 2 3 4"] * 3 + ["1 2 three 4"], 4, "must hold 16 numbers after its header, .* holds 15"),
        (["1 2 3 4 5"] * 4, 4, "must hold 16 numbers after its header, .* holds 20"),
        (["1 2 3 4"] * 3 + ["1 2 nan 4"], 4, "whole class codes, got nan"),
    ],
)
def test_ascii_grids_that_are_not_what_they_declare_are_refused(tmp_path, rows, columns, words):
    path = write_ascii(tmp_path / "fuel.asc", rows, columns=columns)
    refuse(words, path=path, elevation=None, size=4)


def test_enormous_rasters_are_refused_from_their_header(folder):
    # 400 000 x 400 000 bytes are 149 GiB; the sparse file takes 100 kB
    options = {"width": 400_000, "height": 400_000, "count": 1, "dtype": "uint8", "SPARSE_OK": True}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        tiles = {"tiled": True, "blockxsize": 4096, "blockysize": 4096}
        rasterio.open(folder / "map_Elev.tif", "w", driver="GTiff", **options, **tiles).close()
    text = write_ascii(folder / "huge.asc", ["1 2"], columns=400_000).read_text()
    (folder / "huge.asc").write_text(text.replace("nrows 1", "nrows 400000"))
    start = time.perf_counter()
    refuse("elevation must have at most 100000000 cells", path=folder)
    refuse(
        "fuel must have at most 100000000 cells, .* declares 400000 x 400000", path=folder / "huge.asc", elevation=None
    )
    assert time.perf_counter() - start < 2.0


@pytest.mark.parametrize(
    "name, values, options, words",
    [
        ("Elev", np.full((12, 16), NODATA), {}, "elevation must hold data, .*all nodata"),
        ("F13", np.full((12, 16), NODATA), {}, "fuel must hold data, .*all nodata"),
        ("Elev", np.zeros((12, 15)), {}, r"elevation must have the shape of fuel, \(12, 16\), got \(12, 15\)"),
        ("Elev", np.zeros((12, 16)), {"west": 30.0}, "elevation must have the bounds of fuel"),
        ("Elev", np.zeros((12, 16)), {"cell": 10.0}, "elevation must have the bounds of fuel"),
        ("Elev", np.zeros((12, 16)), {"crs": "EPSG:32618"}, "elevation must have the CRS of fuel"),
        ("Elev", np.zeros((12, 16)), {"crs": "EPSG:4326"}, "elevation must have square cells in metres.*EPSG:4326"),
        ("Elev", np.zeros((12, 16, 2)), {}, "elevation must have one band"),
        ("Elev", np.zeros((12, 16)), {"dtype": "complex64", "nodata": None}, "elevation must have one band of real"),
        ("Elev", np.full((12, 16), np.nan), {}, "elevation must be in .* got nan"),
        ("Elev", np.full((12, 16), np.inf), {}, "elevation must be in .* got inf"),
        ("Elev", np.full((12, 16), 32767), {}, "elevation must be in .* got 32767"),
        ("F13", np.full((12, 16), 8.5), {}, "fuel must hold whole class codes, got 8.5"),
        ("F13", np.full((12, 16), np.nan), {}, "fuel must hold whole class codes, got nan"),
        ("F13", np.arange(192).reshape(12, 16), {}, "table .* it lacks 174: 0, 14, .*, 62, ...$"),
    ],
)
def test_bad_layers_are_refused_in_one_line(folder, name, values, options, words):
    write(folder / f"map_{name}.tif", values, **options)
    refuse(words, path=folder, size=6)


@pytest.mark.parametrize("transform", [(30, 0, 0, 0, 30, 0), (30, 0, 0, 0, -20, 0), (30, 9, 0, 9, -30, 0)])
def test_grids_that_are_not_square_and_north_up_are_refused(tmp_path, transform):
    path = write(tmp_path / "fuel.tif", np.full((4, 4), 8), cell=None, transform=rasterio.Affine(*transform))
    refuse("fuel must have square cells in metres, north up", path=path, elevation=None, size=4)
