"""Perimeters by hand: a fire of a few cells, its outline, its area, its place on Earth."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
import torch

from tests.world.rasters import rasterio, refuse
from warp_torchrl.world.terrain.geotiff import local_grid
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.perimeter import perimeters, write_geojson

UTM = rasterio.crs.CRS.from_epsg(32633)
HERE = Grid((4, 4), UTM, rasterio.Affine(100.0, 0.0, 500_000.0, 0.0, -100.0, 4_649_776.22))  # 15 E, about 42 N
METRES = local_grid((4, 4), 100.0)


def arrivals(text):
    """Arrival times drawn row by row, a dot where the fire never came."""
    rows = [[math.nan if cell == "." else 10.0 * int(cell) for cell in row] for row in text.split()]
    return torch.tensor(rows)


def signed_area(ring):
    """The shoelace formula, written out: above 0 where the ring runs counter-clockwise."""
    return 0.5 * sum(x * v - u * y for (x, y), (u, v) in pairwise(ring))


def test_a_cell_is_a_square_and_an_hour_later_a_block():
    found = perimeters(arrivals("0... 66.. 66.. ...."), METRES, [0, 60])
    assert [each["properties"] for each in found["features"]] == [
        {"minutes": 0.0, "hours": 0.0, "area_ha": 1.0},
        {"minutes": 60.0, "hours": 1.0, "area_ha": 5.0},
    ]
    ring = found["features"][0]["geometry"]["coordinates"][0][0]
    # The cell in the north-west of 400 x 400 m; the ring is closed.
    assert {tuple(place) for place in ring} == {(0.0, 300.0), (0.0, 400.0), (100.0, 300.0), (100.0, 400.0)}
    assert ring[0] == ring[-1] and signed_area(ring) == 10_000.0


def test_an_island_is_a_hole_and_runs_the_other_way():
    found = perimeters(arrivals("111. 1.1. 111. ...1"), METRES, [10])
    polygons = sorted(found["features"][0]["geometry"]["coordinates"], key=len)
    assert [len(rings) for rings in polygons] == [1, 2], "cells that touch at a corner are apart"
    outer, hole = polygons[1]
    assert signed_area(outer) == 90_000.0 and signed_area(hole) == -10_000.0
    assert found["features"][0]["properties"]["area_ha"] == 9.0


def test_rings_run_as_geojson_has_them_where_rows_grow_upward_too():
    identity = Grid((4, 4), None, rasterio.Affine.identity())
    outer, hole = perimeters(arrivals("111. 1.1. 111. ....") > 0, identity)["features"][0]["geometry"]["coordinates"][0]
    assert signed_area(outer) == 9.0 and signed_area(hole) == -1.0


def test_a_time_before_the_fire_has_no_perimeter_and_never_is_not_a_time():
    never = arrivals("3... .... .... ....").nan_to_num(math.inf)
    assert [each["properties"]["minutes"] for each in perimeters(never, METRES, [20, 30, 1e9])["features"]] == [
        30.0,
        1e9,
    ]
    assert perimeters(never, METRES, [1e9])["features"][0]["properties"]["area_ha"] == 1.0


def test_what_burned_has_a_perimeter_without_a_time():
    found = perimeters(arrivals("1... .... .... ....") > 0, METRES)
    assert found["features"][0]["properties"] == {"area_ha": 1.0}


def test_a_place_on_earth_is_in_longitude_and_latitude_east_first():
    found = perimeters(arrivals("0... .... .... ....") >= 0, HERE)
    ring = found["features"][0]["geometry"]["coordinates"][0][0]
    # x = 500 km is the central meridian of zone 33, 15 E; y = 4,649,776.22 m is 42 N to the centimetre (Snyder 1987:
    # 0.9996 x the meridian's arc to 42 degrees on WGS84, 4,651,636.9 m).
    assert min(x for x, _ in ring) == pytest.approx(15.0, abs=1e-6)
    assert max(y for _, y in ring) == pytest.approx(42.0, abs=2e-5)
    # 100 m is 100 / (0.9996 x 111,073 m) degrees of latitude there.
    assert max(y for _, y in ring) - min(y for _, y in ring) == pytest.approx(0.0009007, rel=1e-3)
    assert "note" not in found and signed_area(ring) > 0.0
    assert found["features"][0]["properties"]["area_ha"] == 1.0


def test_a_window_lies_where_its_cells_do():
    burned = np.ones((1, 1), bool)
    ring = perimeters(burned, METRES, corner=(3, 2))["features"][0]["geometry"]["coordinates"][0][0]
    assert min(ring)[0] == 200.0 and max(ring)[0] == 300.0 and max(y for _, y in ring) == 100.0


def test_without_a_crs_a_note_says_whose_coordinates_they_are(tmp_path):
    found = perimeters(np.ones((4, 4), bool), METRES)
    write_geojson(tmp_path / "perimeter.geojson", found)
    read = json.loads((tmp_path / "perimeter.geojson").read_text())
    assert read["type"] == "FeatureCollection" and "no CRS" in read["note"]
    assert read["features"][0]["geometry"]["type"] == "MultiPolygon" and len(list(tmp_path.iterdir())) == 1


def test_what_does_not_fit_is_refused():
    refuse("minutes must be given for arrival times", perimeters, arrivals("1... .... .... ...."), METRES)
    refuse("minutes must be given", perimeters, np.ones((4, 4), bool), METRES, [10])
    refuse("corner must leave room", perimeters, np.ones((5, 5), bool), METRES)
    degrees = Grid((4, 4), rasterio.crs.CRS.from_epsg(4326), rasterio.Affine(0.01, 0.0, 15.0, 0.0, -0.01, 42.0))
    refuse("grid must have square cells in metres", perimeters, np.ones((4, 4), bool), degrees)
