"""Raster landscapes: what a world gets of the layers of a folder, and every refusal in one line."""

import json
import pickle
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.world import rasters
from tests.world.rasters import (
    FIRES,
    LANDFIRE,
    NODATA,
    keys,
    needs_fires,
    needs_landfire,
    rasterio,
    read,
    write,
    write_ascii,
    write_enormous,
)
from warp_torchrl.commands.command import train
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.landscape import draw_age
from warp_torchrl.world.terrain.raster import Raster


def refuse(words, **fields):
    """Check that a source is refused in one line with these words."""
    rasters.refuse(words, Raster, **fields)


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


def test_a_world_depends_on_its_key_alone(folder):
    source, key = Raster(path=folder, size=6), keys(64)
    batch = source(key)
    for place in (0, 1, 17, 63):
        alone = source(key[place : place + 1])
        for layer in ("cover", "age", "elevation"):
            assert torch.equal(getattr(alone, layer)[0], getattr(batch, layer)[place])
    assert torch.equal(source(key.flip(0)).elevation, batch.elevation.flip(0))
    assert torch.equal(Raster(path=folder, size=6)(key).elevation, batch.elevation)


def test_the_corner_is_that_of_the_window_in_the_grid(folder):
    source = Raster(path=folder, size=6)
    land = source(keys(50))
    row, column = land.corner.unbind(1)
    assert torch.equal(land.elevation[:, 0, 0], (row + column).float())  # the slope of 1 m a cell, both ways
    assert source.grid.shape == (12, 16) and source.grid.bounds == (0.0, 5e4 - 360.0, 480.0, 5e4)
    assert Raster(path=folder, size=4, row=5, column=2)(keys(2)).corner.tolist() == [[5, 2]] * 2


@needs_landfire
@pytest.mark.parametrize("fuel, table", [("*F13*", "fbfm13"), ("*F40*", "fbfm40")])
def test_both_fuel_layers_of_a_real_map_build_with_elevation_and_canopy(fuel, table):
    source = Raster(path=LANDFIRE, fuel=fuel, table=table, canopy="*CC*", min_fuel=0.8)
    land = source(keys(200))
    share = torch.bincount(land.cover.flatten(), minlength=5) / land.cover.numel()
    # The whole map: 83 % forest, 14 % grassland, 0.5 % lake and 1.9 % bare, with either layer.
    assert 0.75 < share[Cover.FOREST] < 0.92 and 0.08 < share[Cover.GRASSLAND] < 0.2
    assert share[Cover.LAKE] < 0.02 and share[Cover.BARE] < 0.05 and share[Cover.WETLAND] == 0
    forest = land.age[land.cover == Cover.FOREST].float()
    assert forest.min() == 1 and 7.0 < forest.mean() < 8.5  # most of the canopy is of 65 to 85 %
    assert 4.5 < land.age[land.cover == Cover.GRASSLAND].float().mean() < 5.5  # drawn
    assert land.elevation.min() >= 201.0 and land.elevation.max() <= 1101.0


@needs_landfire
def test_a_real_map_may_be_put_on_coarser_cells():
    source = Raster(path=LANDFIRE, resolution=60, resample="mode", canopy="*CC*")
    assert source.cell_size == 60.0 and source.grid.shape == (306, 274)  # of 613 x 549 cells of 30 m
    land = source(keys(50))
    assert 0.7 < (land.cover == Cover.FOREST).float().mean() < 0.95
    whole = Raster(path=LANDFIRE, row=200, column=200, size=128)(keys(1)).elevation[0]
    coarse = Raster(path=LANDFIRE, row=100, column=100, resolution=60, resample="mode")(keys(1)).elevation[0]
    blocks = whole.unflatten(0, (64, 2)).unflatten(2, (64, 2)).mean((1, 3))
    assert (coarse - blocks).abs().mean() < 2.0  # m; the interpolation reaches half a cell farther than the block


@pytest.mark.parametrize("suffix", [".tif", ".asc"])
def test_a_map_without_a_crs_is_told_once(tmp_path, caplog, suffix):
    path = tmp_path / f"fuel{suffix}"
    if suffix == ".tif":
        write(path, np.full((6, 6), 8), crs=None, cell=10.0)
    else:
        write_ascii(path, ["8 8 8 8 8 8"] * 6)
    with caplog.at_level("WARNING", "warp_torchrl"):
        for _ in range(2):
            assert Raster(path=path, elevation=None, size=4).cell_size == 10.0
    assert caplog.messages == [f"{path} has no CRS: its cells are taken as squares of 10 m"]


def test_a_map_with_a_crs_is_not_spoken_of(folder, caplog):
    Raster(path=folder, size=4)
    assert not caplog.messages


# --- Tree age and canopy cover


@pytest.fixture
def trees(tmp_path):
    """A row each of forest, grassland, lake and wetland, 6 cells long, in a table of their own."""
    write(tmp_path / "cover.tif", [[30] * 6, [20] * 6, [0] * 6, [10] * 6], "uint8", nodata=255)
    return {"path": tmp_path, "fuel": "cover.tif", "elevation": None, "size": (4, 6), "min_fuel": 0.1} | {
        "table": {30: "forest", 20: "grassland", 0: "lake", 10: "wetland"}
    }


def test_a_layer_of_ages_makes_the_trees_of_every_cover(trees):
    # 120 years is oldest: 10 x 6 / 120 = 0.5, up to 1; 10 x 90 / 120 = 7.5, up to 8; 500 years is 10. The last is
    # nodata, so drawn.
    write(trees["path"] / "age.tif", [[0, 6, 90, 119, 500, NODATA]] * 4)
    land = Raster(**trees, age="age*", full_age=120.0)(keys(50))
    ages = torch.tensor([0, 1, 8, 10, 10], dtype=torch.uint8)
    for row in (0, 1, 3):
        assert (land.age[:, row, :5] == ages).all()
        assert torch.equal(land.age[:, row, 5], draw_age(keys(50), land.cover)[:, row, 5])
    assert len(torch.unique(land.age[:, 0, 5])) > 5 and (land.age[:, 2] == 0).all()


def test_a_layer_of_canopy_cover_makes_the_trees_of_the_forest(trees):
    # LANDFIRE's class middles 15, 25 .. 95 % are codes 2, 3 .. 10; forest without canopy keeps a young tree.
    write(trees["path"] / "cc.tif", [[0, 15, 25, 95, 100, NODATA]] * 4, "int16")
    land = Raster(**trees, canopy="cc.tif")(keys(50))
    assert (land.age[:, 0, :5] == torch.tensor([1, 2, 3, 10, 10])).all()
    drawn = draw_age(keys(50), land.cover)
    assert torch.equal(land.age[:, 1:], drawn[:, 1:]) and torch.equal(land.age[:, 0, 5], drawn[:, 0, 5])


@pytest.mark.parametrize(
    "name, values, fields, words",
    [
        ("age", [[-1] * 6] * 4, {}, r"^age must be in \[0, 10000\] wherever it is known, got -1"),
        ("age", [[32767] * 6] * 4, {}, "^age must be in .*got 32767"),
        ("age", [[np.nan] * 6] * 4, {}, "^age must be in .*got nan"),
        ("age", [[1] * 5] * 4, {}, r"^age must have the shape of fuel, \(4, 6\), got \(4, 5\)"),
        ("age", [[1] * 6] * 4, {"full_age": 0.0}, "^full_age must be in"),
        ("age", [[1] * 6] * 4, {"canopy": "age.tif"}, "^canopy must be null where age makes the trees"),
        ("canopy", [[101] * 6] * 4, {}, r"^canopy must be in \[0, 100\] wherever it is known, got 101"),
        ("canopy", [[NODATA] * 6] * 4, {}, "^canopy must hold data"),
    ],
)
def test_bad_layers_of_trees_are_refused_in_one_line(trees, name, values, fields, words):
    write(trees["path"] / f"{name}.tif", values)
    refuse(words, **trees, **{name: f"{name}.tif"}, **fields)


def test_the_oldest_trees_stand_on_all_fuel_whatever_the_canopy(trees):
    write(trees["path"] / "cc.tif", [[0, 15, 25, 95, 100, NODATA]] * 4, "int16")
    for canopy in (None, "cc.tif"):
        land = Raster(**trees, canopy=canopy, ages="oldest")(keys(3))
        assert (land.age == torch.tensor([10, 10, 0, 10], dtype=torch.uint8)[:, None]).all()


def test_canopies_are_told_in_percent_and_metres(trees):
    write(trees["path"] / "cc.tif", [[0, 15, 25, 95, 100, NODATA]] * 4, "int16")
    write(trees["path"] / "ch.tif", [[0, 25, 75, 175, 375, NODATA]] * 4, "int16")
    assert Raster(**trees)(keys(1)).layer("canopy_cover") is None
    land = Raster(**trees, canopy="cc.tif", canopy_height="ch.tif", height_unit=0.1)(keys(2))
    assert land.layer("canopy_cover").tolist() == [[[0, 15, 25, 95, 100, 0]] * 4] * 2
    wanted = torch.tensor([0, 2.5, 7.5, 17.5, 37.5, 0]).expand(2, 4, 6)  # LANDFIRE's CH is metres x 10
    torch.testing.assert_close(land.layer("canopy_height"), wanted)
    refuse(
        r"^canopy_height must be in \[0, 150\] \(150 m in units of 1 m\) wherever it is known, got 175",
        **trees,
        canopy_height="ch.tif",
        height_unit=1.0,
    )


def test_crowns_are_told_in_metres_and_kilograms(trees):
    write(trees["path"] / "cc.tif", [[0, 15, 25, 95, 100, NODATA]] * 4, "int16")
    write(trees["path"] / "ch.tif", [[0, 25, 75, 175, 375, NODATA]] * 4, "int16")
    write(trees["path"] / "cbh.tif", [[0, 4, 8, 10, 100, NODATA]] * 4, "int16")
    write(trees["path"] / "cbd.tif", [[0, 1, 12, 20, 45, NODATA]] * 4, "int16")
    crowns = {"canopy_base_height": "cbh.tif", "canopy_bulk_density": "cbd.tif", "height_unit": 0.1}
    whole = {**trees, **crowns, "canopy": "cc.tif", "canopy_height": "ch.tif"}
    source = Raster(**whole, density_unit=0.01)
    land = source(keys(2))
    base, density = torch.tensor([0, 0.4, 0.8, 1, 10, 0]), torch.tensor([0, 0.01, 0.12, 0.2, 0.45, 0])
    torch.testing.assert_close(land.layer("canopy_base_height"), base.expand(2, 4, 6))  # LANDFIRE's CBH is metres x 10
    torch.testing.assert_close(land.layer("canopy_bulk_density"), density.expand(2, 4, 6))  # and CBD kg/m3 x 100
    assert source.files[-2:] == (
        "canopy_base_height: cbh.tif [0.1 m]",
        "canopy_bulk_density: cbd.tif [0.01 kg/m3]",
    )
    refuse("^density_unit must be given with canopy_bulk_density, 0.01 for LANDFIRE or 1 for kg/m3", **whole)
    refuse(r"^canopy_bulk_density must be in \[0, 2\] \(2 kg/m3 in units of 1 kg/m3\)", **whole, density_unit=1.0)
    refuse(
        "^canopy_base_height must be given with canopy and canopy_height, by which crowns burn, got none",
        **{**trees, **crowns},
        density_unit=0.01,
    )


# --- Fuel and nodata


def test_the_fuel_of_a_window_is_its_codes(folder):
    land = Raster(path=folder, size=4, row=5, column=2)(keys(2))
    assert land.layer("fuel").dtype == torch.int16 and (land.layer("fuel") == 8).all()


@needs_landfire
def test_the_fuel_of_a_real_map_is_its_pixels():
    land = Raster(path=LANDFIRE, fuel="*F40*", table="fbfm40", row=300, column=250)(keys(1))
    np.testing.assert_array_equal(land.layer("fuel")[0].numpy(), read(LANDFIRE / "LC22_F40_230.tif")[300:364, 250:314])


def test_nodata_is_no_fuel_where_the_user_says_so(folder):
    source = Raster(path=folder, size=(12, 16), nodata="unburnable", ages="oldest")
    assert source.corner == (0, 0)
    land, unknown = source(keys(2)), torch.zeros(12, 16, dtype=torch.bool)
    unknown[:3, :3] = True
    assert torch.equal(land.cover[1] == Cover.BARE, unknown) and torch.equal(land.layer("fuel")[1] == 99, unknown)
    assert torch.equal(land.age[1] == 0, unknown)
    heights = torch.from_numpy(read(folder / "map_Elev.tif"))
    known = heights != NODATA
    assert torch.equal(land.elevation[1][known], heights[known])
    filled = land.elevation[1][~known]  # of 3 x 3 cells in a corner, on a plane of row + column, 22 at its edge
    assert (filled >= 18.0).all() and (filled <= 24.0).all()


def test_nodata_that_a_fuel_layer_does_not_declare_is_nodata(folder):
    codes = np.full((12, 16), 8)
    codes[0, 0] = -9999
    write(folder / "map_F13.tif", codes, "int16", nodata=None)
    refuse(r"columns 0\.\.0 \(1 cells, ", path=folder, size=4, row=0, column=0)
    assert Raster(path=folder, size=4, row=0, column=0, nodata="unburnable")(keys(1)).layer("fuel")[0, 0, 0] == 99
    table = {8: "forest", -9999: "grassland"}
    assert Raster(path=folder, size=4, row=0, column=0, table=table)(keys(1)).layer("fuel")[0, 0, 0] == -9999


@needs_landfire
def test_a_whole_real_map_can_burn_where_it_is_known():
    source = Raster(path=LANDFIRE, fuel="*F40*", table="fbfm40", size=(613, 549), nodata="unburnable", ages="oldest")
    land = source(keys(1))
    assert (land.layer("fuel") == 99).float().mean() > 0.3 and torch.isfinite(land.elevation).all()
    assert land.elevation.min() >= 201.0 and land.elevation.max() <= 1101.0
    assert torch.equal(land.age > 0, holds_trees(land.cover))


@needs_fires
@pytest.mark.parametrize("fire, table, cell", [("mica", "fbp", 100.0), ("clinge", "fbfm40", 10.0)])
def test_ground_of_real_fires_is_read_whole(fire, table, cell):
    codes = read(FIRES / fire / "fuel.asc")
    layers = {"fuel": "fuel.asc", "elevation": "elevation.asc", "table": table}
    source = Raster(path=FIRES / fire, **layers, size=codes.shape, ages="oldest")
    assert source.cell_size == cell and source.corner == (0, 0)
    np.testing.assert_array_equal(source(keys(1)).layer("fuel")[0].numpy(), codes)


# --- Assets of a vector file


def houses(path, *places, **properties):
    """Write points in the map's own coordinates, at the middles of cells of 30 m."""
    points = [{"type": "Point", "coordinates": [15 + 30 * column, 5e4 - 15 - 30 * row]} for row, column in places]
    features = [{"type": "Feature", "geometry": each, "properties": properties} for each in points]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, "crs": None}))
    return path


@pytest.mark.parametrize("properties, worth", [({}, 1.0), ({"worth": 2.5}, 2.5), ({"VALUE": "4", "name": "farm"}, 4.0)])
def test_a_cell_is_worth_the_sum_of_the_shapes_in_it(folder, properties, worth):
    houses(folder / "houses.geojson", (5, 2), (5, 2), (8, 7), **properties)
    assets = Raster(path=folder, size=(4, 6), row=5, column=2, assets="houses*")(keys(2)).layer("assets")[1]
    wanted = torch.zeros(4, 6)
    wanted[0, 0], wanted[3, 5] = 2 * worth, worth
    assert torch.equal(assets, wanted)


@pytest.mark.parametrize("worth", [-1.0, "much", float("inf")])
def test_a_worth_that_is_none_is_refused_in_one_line(folder, worth):
    houses(folder / "houses.geojson", (5, 2), worth=worth)
    refuse("^assets must have a worth of 0 or more, .*houses.geojson has", path=folder, size=4, assets="houses.geojson")


def test_shapes_off_the_map_are_no_assets(folder):
    houses(folder / "houses.geojson", (50, 2))
    refuse("^assets must hold shapes on the map", path=folder, size=4, assets="houses.geojson")


# --- Layers on different grids


def test_layers_on_other_grids_are_resampled_on_request(folder):
    # Elevation of 60 m cells over the same ground that rises 1 m a metre to the east from its west edge, 60 m off.
    write(folder / "map_Elev.tif", np.tile(60.0 * (np.arange(10) + 0.5), (8, 1)), cell=60.0, west=-60.0)
    fields = {"path": folder, "size": 6, "row": 4, "column": 2}
    refuse(r"^elevation must have the shape of fuel, \(12, 16\), got \(8, 10\)", **fields)
    land = Raster(**fields, resample="nearest")(keys(1))
    wanted = 60.0 + 30.0 * (torch.arange(2, 8) + 0.5)
    torch.testing.assert_close(land.elevation[0], wanted.expand(6, 6), atol=1e-3, rtol=0)
    assert Raster(**fields, resample="nearest").grid.shape == (12, 16)


def test_a_resample_that_is_not_needed_changes_nothing(folder):
    land, same = (Raster(path=folder, size=6, resample=each)(keys(20)) for each in ("refuse", "mode"))
    assert torch.equal(land.cover, same.cover) and torch.equal(land.elevation, same.elevation)
    again = Raster(path=folder, size=6, resample="mode", resolution=30.0)(keys(20))
    assert torch.equal(land.elevation, again.elevation) and torch.equal(land.corner, again.corner)


def test_classes_on_coarser_cells_are_the_most_frequent_ones(tmp_path):
    # Blocks of 2 x 2 cells of 10 m: three forest and a lake, three lake and a forest.
    block = np.block([[np.array([[8, 8], [8, 98]]), np.array([[98, 8], [98, 98]])]])
    path = write(tmp_path / "F13.tif", np.tile(block, (4, 2)), "int16", cell=10.0)
    fields = {"path": path, "elevation": None, "size": 4, "min_fuel": 0.0, "resolution": 20.0}
    source = Raster(**fields, resample="mode")
    assert source.cell_size == 20.0 and source.grid.shape == (4, 4)
    assert source(keys(1)).cover[0].tolist() == [[Cover.FOREST, Cover.LAKE] * 2] * 4
    refuse("^resample must be nearest or mode where resolution is 20, got refuse", **fields)


def test_worldcover_in_degrees_goes_to_metres_with_an_elevation_beside_it(tmp_path):
    # A tenth of a degree of WorldCover, 1/1200 degree a cell, forest in the west and water in the east; elevation in
    # LANDFIRE's projection would do as well as this one in degrees.
    codes = np.full((120, 120), 10)
    codes[:, 60:] = 80
    corner = rasterio.Affine(1 / 1200, 0.0, -72.6, 0.0, -1 / 1200, 44.5)
    where = {"cell": None, "transform": corner, "crs": "EPSG:4326"}
    write(tmp_path / "wc.tif", codes, "uint8", nodata=0, **where)
    write(tmp_path / "Elev.tif", np.full((120, 120), 321.0), **where)
    fields = {"path": tmp_path, "fuel": "wc.tif", "table": "worldcover", "size": 16, "min_fuel": 0.1}
    refuse(
        "^fuel must have square cells in metres, north up, .* in EPSG:4326; give resolution=30 resample=mode to put",
        **fields,
    )
    source = Raster(**fields, resample="mode", resolution=100)
    assert source.grid.crs.to_epsg() == 32618 and source.cell_size == 100.0
    land = source(keys(100))
    # Tenths of a degree there: 111.1 km x 0.1 north, 111.3 km x cos 44.45 x 0.1 = 7.95 km east, and slanted edges.
    assert source.grid.shape[0] in range(111, 114) and source.grid.shape[1] in range(79, 83)
    assert set(land.cover.unique().tolist()) == {Cover.FOREST, Cover.LAKE}
    torch.testing.assert_close(land.elevation, torch.full_like(land.elevation, 321.0), atol=1e-3, rtol=0)
    assert (land.cover[:, :, 1:] >= Cover.LAKE).all() and (land.cover[:, 8].diff(dim=1) == 0).float().mean() > 0.9


@pytest.mark.parametrize("table", [{10: "forest", 80: "LAKE"}, {10: 3, 80: Cover.LAKE}, {"10": "Forest", "80": 0}])
def test_a_table_of_ones_own(tmp_path, table):
    codes = np.full((4, 4), 10)
    codes[0, 0] = 80
    path = write(tmp_path / "worldcover.tif", codes, "uint8", nodata=0)
    cover = Raster(path=path, elevation=None, table=table, size=4)(keys(1)).cover[0]
    assert cover[0, 0] == Cover.LAKE and (cover == Cover.FOREST).sum() == 15


def test_ascii_grids_are_read_and_sidecars_passed_over(tmp_path):
    # The first decimal comes late: left to itself, GDAL would take the grid for whole numbers.
    rows = ["100 200 300 400"] * 3 + ["100 200 300 400.5"]
    write_ascii(tmp_path / "my_Elev.asc", rows)
    write_ascii(tmp_path / "my_F13.ASC", ["8 8 8 98"] * 4)
    (tmp_path / "my_F13.ASC.aux.xml").write_text("<PAMDataset/>")
    source = Raster(path=tmp_path, size=4)
    assert source.cell_size == 10.0
    assert source(keys(1)).elevation[0, 3].tolist() == [100.0, 200.0, 300.0, 400.5]


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


def test_configuration_is_what_shows_and_compares(folder):
    source = Raster(path=str(folder), size=6)
    assert source == Raster(path=str(folder), size=6) != replace(source, min_fuel=0.25)
    assert "tensor" not in repr(source) and "min_fuel=0.5" in repr(source)
    assert pickle.loads(pickle.dumps(source)) == source


# --- Refusals: fields of the configuration


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"path": None}, "path must name .*None"),
        ({"path": ""}, "path must name"),
        ({"path": 7}, "path must be a text or PathLike or null, got 7"),
        ({"path": "/no/such/place"}, "path must name .*/no/such/place"),
        ({"path": "x" * 300}, "path must name .*xxx"),
        ({"size": 13}, "size must fit in the map of 12 x 16 cells, got 13 x 13"),
        ({"size": 3}, "size must"),
        (
            {"size": 11},
            r"size must leave .* 11 x 11 cells without nodata .* rows 0\.\.11, columns 0\.\.15 \(18 cells, 9\.38 %\)",
        ),
        ({"min_fuel": 1.5}, "min_fuel must be in .*1.5"),
        ({"min_fuel": float("nan")}, "min_fuel must be in .*nan"),
        ({"row": 5}, "column must be whole"),
        ({"column": 5}, "row must be whole"),
        ({"row": 5, "column": 11}, r"column must be whole, in 0\.\.10"),
        ({"row": -1, "column": 5}, r"row must be whole, in 0\.\.6 .*got -1"),
        ({"row": 1.5, "column": 5}, "row must be a whole number or null, got 1.5"),
        (
            {"row": 2, "column": 2},
            r"row, column must name a window without nodata, got 2, 2; nodata lies in rows 2\.\.2, columns 2\.\.2 "
            r"\(1 cells, 2\.78 %\); nodata=unburnable makes it no fuel",  # of 6 x 6 cells
        ),
        ({"row": 6, "column": 9}, r"without nodata, got 6, 9; nodata lies in rows 9\.\.11, columns 13\.\.14"),
        ({"table": "fbfm12"}, "table must be one of fbfm13, .*got fbfm12: did you mean fbfm13"),
        ({"table": None}, "table must be"),
        ({"table": {8: "jungle"}}, "table must be .*grassland.*jungle"),
        ({"table": {8: 5}}, "table must be"),
        ({"table": {8.5: 3}}, "table must be .*whole codes"),
        ({"table": {1: 2, 9: 3}}, "table must have every code of fuel, it lacks 1: 8"),
        ({"fuel": "*F40*"}, r"fuel must name one file .*F40.* matches 0: none"),
        ({"fuel": "*.tif"}, "fuel must name one file .*matches 2: map_Elev.tif, map_F13.tif"),
        ({"fuel": None}, "fuel must be a text, got None"),
        ({"elevation": "*height*"}, "elevation must name one file .*matches 0"),
        ({"elevation": "*map*"}, "elevation must name one file .*matches 2"),
        ({"elevation": ""}, "elevation must name one file"),
        ({"age": "*age*"}, "age must name one file .*matches 0"),
        ({"canopy": "*CC*"}, "canopy must name one file .*matches 0"),
        ({"canopy_height": "*Elev*"}, "height_unit must be given with canopy_height, 0.1 for LANDFIRE or 1 for"),
        ({"canopy_height": "*CH*", "height_unit": 0.0}, "height_unit must be in"),
        ({"canopy_height": "*CH*", "height_unit": 0.1}, "canopy_height must name one file .*matches 0"),
        ({"ages": "old"}, "ages must be drawn or oldest, got 'old'"),
        ({"ages": "oldest", "age": "*.tif"}, "ages must be drawn where age"),
        ({"nodata": "lake"}, "nodata must be refuse or unburnable, got 'lake'"),
        ({"resample": "bilinear"}, "resample must be refuse or nearest or mode, got 'bilinear'"),
        ({"resolution": 0.0}, "resolution must be in"),
        ({"resolution": float("nan")}, "resolution must be in"),
        ({"resolution": 1000.0, "resample": "mode"}, "resolution must give 1 to .* cells on fuel, got 1000 m"),
        ({"full_age": -1.0}, "full_age must be in"),
    ],
)
def test_bad_fields_are_refused_in_one_line(folder, fields, words):
    refuse(words, **{"path": folder, "size": 6, **fields})


def test_min_fuel_that_no_window_has_is_refused(tmp_path):
    codes = np.full((6, 6), 98)
    codes[:, 0] = 8
    path = write(tmp_path / "fuel.tif", codes)
    refuse("min_fuel 0.5", path=path, elevation=None, size=4)


# --- Refusals: files


def test_enormous_rasters_are_refused_from_their_header(folder):
    write_enormous(folder / "map_Elev.tif")
    start = time.perf_counter()
    refuse("^elevation must have at most 100000000 cells, .* declares 400000 x 400000", path=folder)
    assert time.perf_counter() - start < 2.0


@pytest.mark.parametrize(
    "name, values, options, words",
    [
        ("Elev", np.full((12, 16), NODATA), {}, "^elevation must hold data, .*all nodata"),
        ("F13", np.full((12, 16), NODATA), {}, "^fuel must hold data, .*all nodata"),
        ("Elev", np.zeros((12, 15)), {}, r"^elevation must have the shape of fuel, \(12, 16\), got \(12, 15\)"),
        ("Elev", np.zeros((12, 16)), {"west": 30.0}, "^elevation must have the bounds of fuel"),
        ("Elev", np.zeros((12, 16)), {"cell": 10.0}, "^elevation must have the bounds of fuel"),
        ("Elev", np.zeros((12, 16)), {"crs": "EPSG:32618"}, "^elevation must have the CRS of fuel"),
        ("Elev", np.zeros((12, 16)), {"crs": "EPSG:4326"}, "^elevation must have square cells in metres.*EPSG:4326"),
        ("Elev", np.zeros((12, 16, 2)), {}, "^elevation must have one band"),
        ("Elev", np.zeros((12, 16)), {"dtype": "complex64", "nodata": None}, "^elevation must have one band of real"),
        ("Elev", np.full((12, 16), np.nan), {}, "^elevation must be in .* got nan"),
        ("Elev", np.full((12, 16), np.inf), {}, "^elevation must be in .* got inf"),
        ("Elev", np.full((12, 16), 32767), {}, "^elevation must be in .* got 32767"),
        ("F13", np.full((12, 16), 8.5), {}, "^fuel must hold whole class codes, got 8.5"),
        ("F13", np.full((12, 16), np.nan), {}, "^fuel must hold whole class codes, got nan"),
        ("F13", np.arange(192).reshape(12, 16), {}, "^table .* it lacks 174: 0, 14, .*, 62, ...$"),
    ],
)
def test_bad_layers_are_refused_in_one_line(folder, name, values, options, words):
    write(folder / f"map_{name}.tif", values, **options)
    refuse(words, path=folder, size=6)


# --- From the command line


def test_a_damaged_raster_ends_training_with_exit_code_2_and_one_line(folder, monkeypatch, capsys):
    whole = (folder / "map_Elev.tif").read_bytes()
    (folder / "map_Elev.tif").write_bytes(whole[: len(whole) // 2])
    before = sorted(folder.iterdir())
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["train.py", "landscape=raster", f"landscape.path={folder}", "landscape.size=8"])
    with pytest.raises(SystemExit) as end:
        train()
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("error: landscape.elevation must be a whole GTiff raster")
    assert sorted(folder.iterdir()) == before


def test_the_command_line_takes_a_table_and_layers_of_ones_own(tmp_path):
    write(tmp_path / "cover.tif", [[1] * 8] * 8, "uint8", nodata=255)
    write(tmp_path / "years.tif", [[50] * 8] * 8)
    overrides = ["landscape=raster", f"landscape.path={tmp_path}", "landscape.fuel=cover.tif", "landscape.size=8"]
    overrides += ["landscape.elevation=null", "landscape.table={1:forest,2:lake}", "landscape.age=years.tif"]
    config = compose_config("train", [*overrides, "landscape.full_age=100", "landscape.resample=mode"])
    land = build(plain(config)["landscape"], "landscape")(keys(2))
    assert (land.cover == Cover.FOREST).all() and (land.age == 5).all()
