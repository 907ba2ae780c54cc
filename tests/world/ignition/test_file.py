"""Fires that start where a file says: every kind of file, where it lies, and every refusal in one line."""

import json
import logging

import numpy as np
import pytest
import torch

from tests.world.rasters import FIRES, needs_fires, rasterio, refuse, write, write_ascii
from warp_torchrl.system.provenance import gathered
from warp_torchrl.world.ignition.file import IgnitionFile, on_fuel, read_ignition
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.world import World

rasterio_warp = pytest.importorskip("rasterio.warp")

UTM = rasterio.crs.CRS.from_epsg(32618)
GRID = Grid((10, 12), UTM, rasterio.Affine(30.0, 0.0, 6e5, 0.0, -30.0, 4.9e6))
"""10 rows and 12 columns of 30 m from (600000, 4900000) on; the middle of row r, column c is 15 + 30 c east, 15 + 30 r
south of that."""
PLACELESS = Grid((10, 12), None, None)


def middle(row, column):
    return 6e5 + 15 + 30 * column, 4.9e6 - 15 - 30 * row


def degrees(*places):
    x, y = rasterio_warp.transform(UTM, "EPSG:4326", *zip(*places))
    return [list(place) for place in zip(x, y)]


def square(top, left, bottom, right):
    """Return the ring of a square by its edges, in cells."""
    corners = [(top, left), (top, right), (bottom, right), (bottom, left), (top, left)]
    return [(6e5 + 30 * column, 4.9e6 - 30 * row) for row, column in corners]


def feature(kind, coordinates, **properties):
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def collection(*features, **members):
    return {"type": "FeatureCollection", "features": list(features), **members}


def written(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def cells(path, grid=GRID):
    return [tuple(place) for place in np.argwhere(read_ignition(path, grid)).tolist()]


def rasterised(*places):
    marks = np.zeros(GRID.shape, bool)
    for place in places:
        marks[place] = True
    return marks


# --- Files


@pytest.mark.parametrize(
    "text",
    [
        "row,column\n2,3\n7,11\n",
        "\ufeffRow, Column ,note\n2,3,a\n7,11.0,b\n",
        "x,y\n{0[0]},{0[1]}\n{1[0]},{1[1]}\n",
        "longitude,latitude\n{2[0][0]},{2[0][1]}\n{2[1][0]},{2[1][1]}\n",
        "lat,lon\n{2[0][1]},{2[0][0]}\n{2[1][1]},{2[1][0]}\n",
    ],
)
def test_points_of_a_csv_light_the_cells_that_they_lie_in(tmp_path, text):
    places = middle(2, 3), middle(7, 11)
    path = written(tmp_path / "points.csv", text.format(*places, degrees(*places)))
    assert cells(path) == [(2, 3), (7, 11)]


@pytest.mark.parametrize(
    "content",
    [
        b"row;column\n2;3\n",
        b"sep=;\r\nrow;column;name\r\n2;3;a\r\n",
        b"# the first smoke\nrow\tcolumn\n2\t3\n\n",
        b'"Row (from 0)","Col"\n"2","3"\n',
        b"row column\n 2  3\n",
        b"x;y\n600105,5;4899925,25\n",
        b"Easting [m];Northing [m]\n600105;4899925\n",
        "row,column,lieu\n2,3,for\u00eat\n".encode("latin-1"),
        "\ufeffrow,column\n2,3\n".encode("utf-16-le"),
    ],
)
def test_points_may_be_written_as_spreadsheets_write_them(tmp_path, content):
    (tmp_path / "points.csv").write_bytes(content)
    assert cells(tmp_path / "points.csv") == [(2, 3)]


def test_what_was_read_of_points_is_told(tmp_path):
    path = written(tmp_path / "points.csv", "id,Lon,Lat\n7,{0[0][0]},{0[0][1]}\n".format(degrees(middle(2, 3))))
    with gathered() as files:
        read_ignition(path, GRID)
    assert files[0].read == {"Lon": "degrees of EPSG:4326", "Lat": "degrees of EPSG:4326"}
    assert files[0].left == ("id",) and files[0].key == "ignition.path"


def test_rows_and_columns_need_no_place_on_earth(tmp_path):
    assert cells(written(tmp_path / "a.csv", "row,column\n2,3\n"), PLACELESS) == [(2, 3)]


POINTS = degrees(middle(2, 3), middle(7, 11))
RING = degrees(*square(2, 3, 5, 8))
OWN = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32618"}}


@pytest.mark.parametrize(
    "document, lit",
    [
        ({"type": "Point", "coordinates": POINTS[0]}, [(2, 3)]),
        ({"type": "Point", "coordinates": [*POINTS[0], 350.0]}, [(2, 3)]),
        ({"type": "MultiPoint", "coordinates": POINTS}, [(2, 3), (7, 11)]),
        (feature("Point", POINTS[1]), [(7, 11)]),
        (collection(feature("Point", POINTS[1]), {"type": "Feature", "geometry": None}), [(7, 11)]),
        (collection(feature("Point", middle(4, 4)), crs=OWN), [(4, 4)]),
        (collection(feature("Point", middle(4, 4)), crs=None), [(4, 4)]),
        (feature("LineString", degrees(middle(1, 2), middle(1, 5))), [(1, 2), (1, 3), (1, 4), (1, 5)]),
        (feature("Polygon", [RING]), [(row, column) for row in (2, 3, 4) for column in (3, 4, 5, 6, 7)]),
        (feature("MultiPolygon", [[RING]]), [(row, column) for row in (2, 3, 4) for column in (3, 4, 5, 6, 7)]),
    ],
)
def test_shapes_of_geojson_light_the_cells_in_them(tmp_path, document, lit):
    assert cells(written(tmp_path / "fire.geojson", document)) == lit


def test_a_perimeter_that_leaves_the_map_lights_what_is_on_it(tmp_path):
    beyond = feature("Polygon", [degrees(*square(-2, -3, 2, 1))])
    assert cells(written(tmp_path / "fire.json", beyond)) == [(0, 0), (1, 0)]


def test_a_hole_of_a_perimeter_is_not_lit_and_a_small_one_lights_what_it_touches(tmp_path):
    holed = [degrees(*square(2, 3, 5, 8)), degrees(*square(3, 4, 4, 7))]
    lit = cells(written(tmp_path / "holed.geojson", feature("Polygon", holed)))
    assert len(lit) == 15 - 3 and (3, 5) not in lit
    small = feature("Polygon", [degrees(*square(2.6, 3.6, 2.9, 3.9))])  # it holds no cell's middle
    assert cells(written(tmp_path / "small.geojson", small)) == [(2, 3)]


@pytest.mark.parametrize("told, encoding", [(True, "cp1252"), (False, "utf-8"), (True, "gbk")])
def test_a_shapefile_lights_what_its_perimeter_holds(tmp_path, told, encoding, caplog):
    shapefile = pytest.importorskip("shapefile")
    with shapefile.Writer(str(tmp_path / "fire.shp"), shapeType=shapefile.POLYGON, encoding=encoding) as writer:
        writer.field("NAME", "C")
        writer.poly([square(2, 3, 5, 8)])
        writer.record({"cp1252": "Peñón", "utf-8": "Clinge", "gbk": "山火"}[encoding])
    if told:
        written(tmp_path / "fire.prj", UTM.to_wkt())
    assert cells(tmp_path / "fire.shp") == [(row, column) for row in (2, 3, 4) for column in (3, 4, 5, 6, 7)]
    assert ("has no .prj, so its coordinates are taken for the map's own" in caplog.text) != told


@pytest.mark.parametrize("suffix", [".tif", ".asc"])
def test_a_raster_lights_what_is_neither_0_nor_nodata(tmp_path, suffix):
    values = np.zeros((4, 5), int)
    values[1, 2], values[3, 0], values[0, 0] = 1, 7, -9999
    transform = rasterio.Affine(10.0, 0.0, 0.0, 0.0, -10.0, 40.0)
    if suffix == ".tif":
        write(tmp_path / "lit.tif", values, "int16", cell=None, transform=transform, crs=UTM)
    else:
        write_ascii(tmp_path / "lit.asc", [" ".join(map(str, row)) for row in values])
    assert cells(tmp_path / f"lit{suffix}", Grid((4, 5), UTM, transform)) == [(1, 2), (3, 0)]
    assert cells(tmp_path / f"lit{suffix}", Grid((4, 5), None, None)) == [(1, 2), (3, 0)]
    refuse("^ignition.path must have the shape of", read_ignition, tmp_path / f"lit{suffix}", GRID)


def test_what_lies_off_the_map_is_left_out_and_counted(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        assert cells(written(tmp_path / "a.csv", "row,column\n2,3\n10,3\n-1,0\n0,-1\n")) == [(2, 3)]
        far = {"type": "MultiPoint", "coordinates": degrees(middle(2, 3), middle(2, 12))}
        assert cells(written(tmp_path / "b.json", far)) == [(2, 3)]
    assert "3 of 4 points of" in caplog.text and "1 of 2 shapes of" in caplog.text


@pytest.mark.parametrize(
    "file, content, words",
    [
        ("none.csv", None, "^ignition.path must name a file that exists, one of .csv, .tif"),
        ("fire.kml", "<kml/>", "^ignition.path must name a file that exists, one of .csv"),
        ("a.csv", "", "^ignition.path must have the columns row,column or x,y .*has no points"),
        ("a.csv", "row,column\n", "has no points"),
        ("a.csv", "Year,Ncell\n1,5\n", "has the columns year,ncell"),
        ("a.csv", "row,column\n1,two\n", "^ignition.path must have a number for column, line 2 of .* has 'two'"),
        ("a.csv", "row,column\n1\n", "must have a number for column, line 2 of .* has None"),
        ("a.csv", "row,column\n1,nan\n", "must have a number for column"),
        ("a.csv", "x,y\n600105,5,4899925,5\n", "must have 2 cells in each row, line 2 of .* has 4"),
        ("a.csv", "row,column,row\n1,2,3\n", "must have one column row, .* has 2"),
        ("a.csv", "x;y\n600105,5;4899925\n600105.5;4899925\n", "column x must have one decimal sign"),
        ("a.csv", 'x,y\n"600,105","4,899,925"\n', "column x must have decimal points, '600,105' may be thousands"),
        ("a.csv", "row,column\n1,\x002\n", "^ignition.path must be a CSV file that can be read, .*it has NUL bytes"),
        ("a.csv", "row,column\n1.5,2\n", "must have whole rows and columns, from 0"),
        ("a.csv", "row,column\n1,12\n", "must have points on the map of 10 x 12 cells, .* has 1, none of them there"),
        ("a.csv", "x,y\n0,0\n", "must have points on the map"),
        ("a.geojson", "fire", "^ignition.path must be a GeoJSON file"),
        ("a.geojson", "[1]", "^ignition.path must be a GeoJSON file, .*it is not an object"),
        ("a.geojson", "[" * 100_000, "^ignition.path must be a GeoJSON file"),
        ("a.geojson", {"type": "FeatureCollection"}, "must be a GeoJSON file"),
        ("a.geojson", {"type": "Circle", "coordinates": [1, 2]}, "must hold points, lines or polygons"),
        ("a.geojson", {"type": "Point", "coordinates": []}, "must hold points, lines or polygons"),
        ("a.geojson", {"type": "Point", "coordinates": ["a", "b"]}, "must hold points, lines or polygons"),
        ("a.geojson", feature("Polygon", [POINTS]), "must hold points, lines or polygons"),
        ("a.geojson", feature("LineString", POINTS[:1]), "must hold points, lines or polygons"),
        ("a.geojson", {"type": "Point", "coordinates": [4.0, 51.0]}, "shapes on the map .* has 1, none of them there"),
        ("a.geojson", collection(), "shapes on the map .* has 0"),
        (
            "a.geojson",
            collection(feature("Point", [1, 2]), crs={"properties": {"name": "Mars"}}),
            "a CRS that is known",
        ),
        ("a.shp", "no shapefile", "^ignition.path must be a whole shapefile with its .shx and .dbf"),
        ("a.tif", "no raster", "^ignition.path must be a whole GTiff raster"),
    ],
)
def test_files_that_light_nothing_are_refused_in_one_line(tmp_path, file, content, words):
    if content is not None:
        written(tmp_path / file, content)
    refuse(words, read_ignition, tmp_path / file, GRID)


def test_degrees_need_a_map_with_a_place(tmp_path):
    path = written(tmp_path / "a.csv", "longitude,latitude\n-73,44\n")
    refuse(
        "must have the map's own coordinates, .* as the map has no CRS", read_ignition, path, GRID._replace(crs=None)
    )
    refuse("must be a CSV of row,column where the landscape has no place", read_ignition, path, PLACELESS)
    own = written(tmp_path / "b.json", collection(feature("Point", middle(4, 4)), crs=None))
    assert cells(own, GRID._replace(crs=None)) == [(4, 4)]


def test_ground_that_cannot_burn_is_not_lit(tmp_path, caplog):
    lit, fuel = rasterised((2, 3), (4, 5)), rasterised((4, 5), (6, 6))
    assert np.array_equal(on_fuel(lit, fuel, "a.csv"), rasterised((4, 5)))
    assert "1 of the 2 cells of a.csv cannot burn and are not lit" in caplog.text
    refuse(
        "must light ground that can burn, a.csv lights row 2, column 3, where",
        on_fuel,
        rasterised((2, 3)),
        fuel,
        "a.csv",
    )
    refuse("a.csv lights 2 cells, the first at row 2", on_fuel, lit, rasterised((0, 0)), "a.csv")


# --- Worlds


FOREST = np.full((10, 12), 3)


@pytest.fixture
def points(tmp_path):
    return str(written(tmp_path / "points.csv", "row,column\n2,3\n7,11\n"))


def test_every_world_burns_first_where_the_file_says(points):
    world = World(landscape=Array(cover=FOREST, ages="oldest"), ignition=IgnitionFile(path=points))
    state = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    assert torch.equal(state.cells == 11, torch.from_numpy(rasterised((2, 3), (7, 11))).expand(3, -1, -1))


def test_a_window_is_lit_where_the_file_says_of_the_map(points, caplog):
    land = Array(cover=FOREST, ages="oldest", size=5, row=1, column=2)
    lit = IgnitionFile(path=points, radius=1).over(land)(torch.arange(2), torch.ones(2, 5, 5, dtype=torch.bool))
    assert lit[1].nonzero().tolist() == [[row, column] for row in (0, 1, 2) for column in (0, 1, 2)]
    assert "1 of the 2 cells of" in caplog.text and "lie off the window" in caplog.text


@pytest.mark.parametrize(
    "landscape, words",
    [
        (Array(cover=FOREST, ages="oldest", size=5), "^ignition.path must have one ground for all worlds: give landsc"),
        (Perlin(size=16), "^ignition.path must have one ground for all worlds"),
        (
            Array(cover=FOREST, ages="oldest", size=4, row=4, column=0),
            r"the world's window, rows 4\.\.7, columns 0\.\.3",
        ),
        (
            Array(cover=FOREST),
            "^ignition.path must light trees of known age .* only 2 cells, give landscape.ages=oldest",
        ),
        (Array(cover=FOREST * 0 + 4), "^ignition.path must light ground that can burn"),
    ],
)
def test_landscapes_where_the_file_does_not_fit_are_refused(points, landscape, words):
    refuse(words, World, landscape=landscape, ignition=IgnitionFile(path=points))


def test_trees_too_young_to_burn_are_told_of(points):
    world = World(landscape=Array(cover=FOREST, age=FOREST * 0 + 1), ignition=IgnitionFile(path=points))
    start = torch.zeros(1, dtype=torch.int64)
    refuse(
        "^ignition.path must light a tree that can burn, in some world .* see landscape.ages", world.reset, start, start
    )


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"path": None}, "^path must name a file of the cells that burn first, got None"),
        ({"path": ""}, "^path must name a file"),
        ({"path": "x" * 300}, "^path must name a file"),
        ({"radius": 9}, "^radius must be in"),
        ({"head_start": -1}, "^head_start must be in"),
    ],
)
def test_bad_fields_are_refused_in_one_line(points, fields, words):
    refuse(words, IgnitionFile, **{"path": points, **fields})


@needs_fires
@pytest.mark.parametrize("fire, table", [("mica", "fbp"), ("clinge", "fbfm40"), ("glacier", "fbp")])
def test_real_fires_start_in_their_cell_and_their_scars_are_ignitions_too(fire, table):
    folder = FIRES / fire
    fuel = rasterio.open(folder / "fuel.asc").read(1)
    layers = {"fuel": "fuel.asc", "elevation": "elevation.asc", "table": table, "ages": "oldest"}
    land = Raster(path=folder, **layers, size=fuel.shape)
    lit = IgnitionFile(path=folder / "ignition.csv").over(land)(torch.zeros(1), torch.ones(1, *fuel.shape) > 0)
    place = (folder / "ignition.csv").read_text().split()[1]
    assert lit[0].nonzero().tolist() == [[int(each) for each in place.split(",")]]
    scar = rasterio.open(folder / "scar.asc").read(1) == 1
    assert np.array_equal(read_ignition(folder / "scar.asc", land.grid), scar)
