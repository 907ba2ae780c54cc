"""Barriers as cells that no fire enters."""

import json

import numpy as np
import pytest
import torch

from tests.world.backends.test_growing import land, lit, turning
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER

pytest.importorskip("rasterio")
from warp_torchrl.world.terrain.barriers import closed, read_barriers
from warp_torchrl.world.terrain.geotiff import local_grid

GRID = local_grid((40, 64), 30.0)


def barrier(path, kind, coordinates):
    shape = {"type": "Feature", "properties": {}, "geometry": {"type": kind, "coordinates": coordinates}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": None, "features": [shape]}))
    return path


def burns(cells):
    """Where a fire from the north-west burns, in even fuel that cells are taken from."""
    ground = land(1, GRID.shape, relief=False).with_layers(fuel=torch.full((1, *GRID.shape), 2, dtype=torch.int16))
    ground.age[0][torch.from_numpy(cells)] = 0
    fires = Fires(fire=RateFire(model="fbp", cell_deviation=0.3), landscape=ground, spells=turning(9), cell_size=30.0)
    return on_map(fires.burn(lit(GRID.shape, (4, 4)), world_key(torch.arange(1))))[0] < NEVER


def test_fire_does_not_cross_a_diagonal(tmp_path):
    steps = np.zeros(GRID.shape, bool)
    steps[np.arange(40), 39 - np.arange(40)] = True  # cells that hang together by corners
    assert bool(burns(steps)[30:, 30:].any()), "fire goes across corners"
    assert not bool(burns(closed(steps))[30:, 30:].any()) and int(closed(steps).sum()) == 79
    # from the west side to the north side, through corners of cells
    line = barrier(tmp_path / "road.geojson", "LineString", [[-30.0, -30.0], [1230.0, 1230.0]])
    found = burns(read_barriers(line, GRID))
    assert bool(found[:15, :15].any()) and not bool(found[30:, 30:].any())


def test_a_line_closes_what_it_touches_and_what_is_within_half_its_width(tmp_path):
    # 1185 m north is the middle of row 0; a line along row 10
    line = barrier(tmp_path / "river.geojson", "LineString", [[0.0, 885.0], [1920.0, 885.0]])
    assert np.flatnonzero(read_barriers(line, GRID).any(1)).tolist() == [10]
    assert np.flatnonzero(read_barriers(line, GRID, 50.0).any(1)).tolist() == [10]  # 25 m: no other middle
    assert np.flatnonzero(read_barriers(line, GRID, 61.0).all(1)).tolist() == [9, 10, 11]


def test_closing_a_corner_may_open_another(tmp_path):
    cells = np.array([[0, 0, 0, 1], [0, 0, 1, 0], [0, 1, 0, 0]], bool)
    found = closed(cells)
    blocks = np.lib.stride_tricks.sliding_window_view(found, (2, 2)).reshape(-1, 4)
    assert not any(each.tolist() in ([True, False, False, True], [False, True, True, False]) for each in blocks)
    assert (found | ~cells).all()


def test_points_are_no_barrier(tmp_path):
    with pytest.raises(ValueError, match=r"barriers must be lines or polygons, .* has points"):
        read_barriers(barrier(tmp_path / "a.geojson", "Point", [100.0, 100.0]), GRID)
    with pytest.raises(ValueError, match="barriers must name a file of lines or polygons, one of "):
        read_barriers(tmp_path / "nowhere.geojson", GRID)
