"""One ground for all worlds, and everything else as it was."""

import copy
import pickle

import pytest
import torch

from tests.conftest import small_world
from tests.world.rasters import LANDFIRE, keys, needs_landfire, refuse
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.terrain.fixed import Fixed
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.terrain.source import LandscapeSource

SOURCE = Perlin(size=12, relief=40.0)


def test_every_world_has_the_ground_of_the_seed():
    ground, own = Fixed(source=SOURCE, seed=3)(keys(5)), SOURCE(world_key(torch.tensor([3])))
    for name, layer in ground.leaves().items():
        assert layer.shape[0] == 5 and (layer == own.leaves()[name]).all(), name


def test_fires_winds_and_starts_stay_those_of_each_world():
    usual, fixed = small_world(), small_world(landscape=Fixed(source=SOURCE, seed=2))
    seeds, first = torch.arange(6), torch.zeros(6, dtype=torch.int64)
    states = usual.reset(seeds, first), fixed.reset(seeds, first)
    assert (states[0].key == states[1].key).all() and (states[0].wind == states[1].wind).all()
    assert (states[0].vehicles.base == states[1].vehicles.base).all()
    assert (states[1].cells[2] == states[0].cells[2]).all(), "the world whose own ground it is"
    burning = states[1].cells > 10
    assert any((burning[0] != each).any() for each in burning), "fires start in different places"


def test_a_fixed_landscape_is_a_landscape_that_can_be_copied():
    fixed = Fixed(source=SOURCE, seed=2)
    assert isinstance(fixed, LandscapeSource) and fixed.size == 12
    assert pickle.loads(pickle.dumps(fixed)) == copy.deepcopy(fixed) == fixed
    with pytest.raises(AttributeError, match="grid"):
        _ = fixed.grid
    refuse("seed must be in", Fixed, source=SOURCE, seed=-1)


@needs_landfire
def test_a_window_of_a_raster_is_one_and_its_grid_can_be_asked_for():
    source = Raster(path=LANDFIRE, size=16)
    fixed = Fixed(source=source, seed=1)
    corner = fixed(keys(4)).corner
    assert (corner == corner[0]).all() and len(source(keys(4)).corner.unique(dim=0)) > 1
    assert fixed.grid is source.grid and fixed.cell_size == 30.0 and fixed.extent == source.extent
