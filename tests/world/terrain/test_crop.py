"""Windows of a map: which ones qualify, how they are drawn, and what a world gets of them."""

import numpy as np
import pytest
import torch

from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.crop import DRAWN, Crop
from warp_torchrl.world.terrain.landscape import draw_age


def keys(count):
    return world_key(torch.arange(count), torch.zeros(count, dtype=torch.int64))


def forest(rows, columns):
    return np.full((rows, columns), Cover.FOREST, np.uint8)


def places(source, count=500):
    """Return the corners that worlds get, as a set of pairs."""
    return {tuple(corner) for corner in source(keys(count)).corner.tolist()}


def numbered(rows, columns):
    """Return an elevation that tells the place: 100 x row + column."""
    return np.add.outer(100.0 * np.arange(rows), np.arange(columns)).astype(np.float32)


def test_the_corner_tells_where_the_window_lies():
    land = Crop(cover=forest(12, 16), elevation=numbered(12, 16), size=(4, 6))(keys(50))
    assert land.corner.shape == (50, 2) and land.corner.dtype == torch.int64
    row, column = land.corner.unbind(1)
    torch.testing.assert_close(land.elevation[:, 0, 0], (100.0 * row + column))
    torch.testing.assert_close(land.elevation[:, 3, 5], (100.0 * (row + 3) + column + 5))
    assert len(places(Crop(cover=forest(12, 16), size=(4, 6)), 2000)) == 9 * 11


def test_a_window_that_is_the_whole_map_has_its_corner_at_zero():
    land = Crop(cover=forest(5, 7), elevation=numbered(5, 7), size=(5, 7))(keys(3))
    assert land.corner.tolist() == [[0, 0]] * 3
    assert all(torch.equal(each, torch.from_numpy(numbered(5, 7))) for each in land.elevation)


def test_windows_hold_no_unknown_cell():
    # 6 x 6 with the middle cell (2, 3) unknown: 4 x 4 windows start in 0..2 x 0..2, and all hold rows 2..3, columns
    # 2..3. In 5 x 9 with (4, 2) unknown, those that start in row 0 do not reach row 4; those in row 1 must start right
    # of column 2: (0, 0..5) and (1, 3..5).
    known = np.ones((6, 6), bool)
    known[2, 3] = False
    with pytest.raises(ValueError, match=r"size must leave some place, .* 4 x 4 cells without nodata"):
        Crop(cover=forest(6, 6), known=known, size=4)
    known = np.ones((5, 9), bool)
    known[4, 2] = False
    wanted = {(0, column) for column in range(6)} | {(1, column) for column in (3, 4, 5)}
    assert places(Crop(cover=forest(5, 9), known=known, size=4)) == wanted


def test_windows_keep_to_places_with_fuel():
    # Forest in the last 2 of 8 columns: of 4 columns from c on, max(0, c - 2) of 4 are forest.
    cover = np.full((4, 8), Cover.LAKE, np.uint8)
    cover[:, 6:] = Cover.FOREST
    assert places(Crop(cover=cover, size=4, min_fuel=0.5)) == {(0, 4)}
    assert places(Crop(cover=cover, size=4, min_fuel=0.25)) == {(0, 3), (0, 4)}
    assert places(Crop(cover=cover, size=4, min_fuel=0.0)) == {(0, 3), (0, 4)}
    with pytest.raises(ValueError, match=r"min_fuel 0\.51"):
        Crop(cover=cover, size=4, min_fuel=0.51)
    assert places(Crop(cover=cover, size=4, row=0, column=1)) == {(0, 1)}


def test_windows_are_drawn_evenly():
    # 4 windows of 4 x 4 in a 4 x 7 strip, 250 each of 1000; standard deviation sqrt(1000 * 1/4 * 3/4) = 14
    column = Crop(cover=forest(4, 7), size=4)(keys(1000)).corner[:, 1]
    counts = torch.bincount(column, minlength=4)
    assert len(counts) == 4 and (counts - 250).abs().max() < 4 * 14


def test_a_world_depends_on_its_key_alone():
    source, key = Crop(cover=forest(20, 30), elevation=numbered(20, 30), size=6), keys(64)
    batch = source(key)
    for place in (0, 1, 17, 63):
        alone = source(key[place : place + 1])
        for layer in ("cover", "age", "elevation", "corner"):
            assert torch.equal(getattr(alone, layer)[0], getattr(batch, layer)[place])
    assert torch.equal(source(key.flip(0)).corner, batch.corner.flip(0))


def test_ages_are_those_of_the_map_and_drawn_where_it_has_none():
    age = np.full((8, 8), 7, np.uint8)
    age[:, 4:] = DRAWN
    cover = forest(8, 8)
    cover[0] = Cover.LAKE
    land = Crop(cover=cover, age=age, size=8)(keys(3))
    assert (land.age[:, 1:, :4] == 7).all() and (land.age[:, 0] == 0).all()
    assert torch.equal(land.age[:, 1:, 4:], draw_age(keys(3), land.cover)[:, 1:, 4:])
    assert land.elevation is None


def test_a_fixed_window_may_have_any_fuel_but_must_be_known():
    known = np.ones((6, 6), bool)
    known[0, 0] = False
    cover = np.full((6, 6), Cover.LAKE, np.uint8)
    assert places(Crop(cover=cover, known=known, size=4, row=1, column=2)) == {(1, 2)}
    with pytest.raises(ValueError, match="row, column must name a window without nodata, got 0, 0"):
        Crop(cover=cover, known=known, size=4, row=0, column=0)


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"size": 7}, "size must fit in the map of 6 x 9 cells, got 7 x 7"),
        ({"size": (4, 10)}, "size must fit in the map"),
        ({"size": 3}, "size must"),
        ({"row": 1}, r"column must be whole, in 0\.\.5 for a window in the map, got None"),
        ({"column": 1}, r"row must be whole, in 0\.\.2 .*got None"),
        ({"row": 3, "column": 0}, r"row must be whole, in 0\.\.2 .*got 3"),
        ({"row": 0, "column": -1}, r"column must be whole, in 0\.\.5 .*got -1"),
    ],
)
def test_windows_that_do_not_fit_are_refused(fields, words):
    with pytest.raises(ValueError, match=words):
        Crop(**{"cover": forest(6, 9), "size": 4, **fields})


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_a_world_is_the_same_on_every_device():
    age = np.random.default_rng(0).integers(0, 11, (20, 30)).astype(np.uint8)
    source, key = Crop(cover=forest(20, 30), elevation=numbered(20, 30), age=age, size=6), keys(64)
    here, there = source(key), source(key.cuda())
    for layer in ("cover", "age", "elevation", "corner"):
        assert torch.equal(getattr(here, layer), getattr(there, layer).cpu())


@pytest.mark.parametrize("size", [(6, 8), (4, 4)])
def test_no_tree_stands_where_none_can(size):
    cover = np.full((6, 8), Cover.LAKE, np.uint8)
    cover[2:] = Cover.GRASSLAND
    land = Crop(cover=cover, age=np.full((6, 8), 7, np.uint8), size=size)(keys(20))
    assert land.age.dtype == torch.uint8
    assert torch.equal(land.age, torch.where(land.cover == int(Cover.LAKE), 0, 7).to(torch.uint8)) and land.age.any()
