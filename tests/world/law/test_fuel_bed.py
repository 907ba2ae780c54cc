"""Fuel models and the codes of rasters: whose they are, and whose they are not."""

import numpy as np
import pytest
import torch

from tests.world.rasters import keys, write
from warp_torchrl.world.behaviour.fbp import fbp_spread
from warp_torchrl.world.behaviour.moistures import moisture_row
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.world import World

MODELS = {"fbfm13": 8, "fbfm40": 183, "fbp": 2}


def raster(folder, codes, table):
    path = write(folder / "codes.tif", np.broadcast_to(codes, (12, 12)), "int16")
    return Raster(path=path, elevation=None, table=table, size=12, ages="oldest")


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("table", MODELS)
def test_codes_of_another_model_are_refused(tmp_path, table, model):
    ground = raster(tmp_path, MODELS[table], table)
    if table == model:
        assert World(landscape=ground, fire=RateFire(model=model)).fire.minutes > 0.0
        return
    with pytest.raises(ValueError, match=f"^fire.model must be that of landscape.table, {table}, got {model}$"):
        World(landscape=ground, fire=RateFire(model=model))


@pytest.mark.parametrize("model", MODELS)
def test_land_cover_burns_as_the_fuels_of_its_cover_do(tmp_path, model):
    ground = raster(tmp_path, np.where(np.arange(12) < 6, 30, 50), "worldcover")  # grassland, built-up
    one = ground(keys(1))
    law = RateFire(model=model)
    assert one.layer("fuel") is None
    flammability = law.flammability(one)[0]
    assert (flammability[:, :6] > 0.0).all() and (flammability[:, 6:] == 0.0).all()
    state = World(landscape=ground, fire=law).reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    assert is_burning(state.cells).any()


def test_a_table_of_ones_own_says_nothing_of_the_model(tmp_path):
    ground = raster(tmp_path, 8, {8: "forest"})
    assert World(landscape=ground, fire=RateFire(model="fbfm13")).fire.minutes > 0.0


def test_moisture_is_in_0_to_400_per_cent():
    assert moisture_row({"live_woody": 400.0})[4] == 400.0 and moisture_row({"dead_1h": 0.0})[0] == 0.0
    for value in (-0.1, 400.1):
        with pytest.raises(ValueError, match=r"moisture must be in \[0, 400\], got dead_1h"):
            moisture_row({"dead_1h": value})


@pytest.mark.parametrize(
    "code, state, slower",
    [
        (31, {"curing": 60.0}, True),
        (13, {"green": True}, True),  # D-1 becomes D-2
        (40, {"percent_conifer": 90.0}, False),
        (6, {"foliar_moisture": 150.0}, True),
    ],
)
def test_the_state_of_canadian_fuel_is_that_of_the_law(code, state, slower):
    cover = torch.full((1, 1, 1), 3, dtype=torch.uint8)
    land = Landscape(cover, torch.full_like(cover, 10), None).with_layers(fuel=torch.full((1, 1, 1), code).short())
    wind, moisture = torch.tensor([7.0, 0.0])[None, :, None, None], torch.tensor([[6.0, 7, 8, 60, 90, 95, 90]])
    usual, other = (
        float(RateFire(model="fbp", **each).bed.spread(land, wind, moisture, 30.0).head) for each in ({}, state)
    )
    air = {"wind_speed": 7.0, "wind_bearing": 270.0, "slope": 0.0, "aspect": 0.0, "ffmc": 95.0, "bui": 90.0}
    told = fbp_spread(torch.tensor([code]), **air, **state)
    assert other == pytest.approx(float(told.head), rel=1e-4) and (other < usual) == slower
