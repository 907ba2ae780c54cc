"""The package pyretechnics computes the same fires, for every fuel model over winds, slopes and moistures."""

import itertools
import math

import numpy as np
import pytest

from warp_torchrl import rate_of_spread
from warp_torchrl.benchmark.witness import witness_errors
from warp_torchrl.world.behaviour.standard_fuels import NOT_BURNABLE, anderson_13, scott_burgan_40

fuel_models = pytest.importorskip("pyretechnics.fuel_models", reason="needs the extra witness, and Python below 3.13")
from pyretechnics import surface_fire, vector_utils  # noqa: E402

MOISTURES = ("dead_1h", "dead_10h", "dead_100h", "live_herbaceous", "live_woody")
DAMP = [(3, 4, 5, 30, 60), (6, 7, 8, 60, 90), (6, 7, 8, 90, 60), (10, 12, 13, 120, 150), (18, 20, 22, 75, 100)]
FIELDS = {"head": 0, "length_to_breadth": 2, "intensity": 3, "flame_length": 4}


def witness(code, damp, speed, bearing, slope, aspect):
    """Rate [m/min], direction [degrees], length to breadth, intensity [kW/m] and flame length [m] of the witness."""
    dead_1h, dead_10h, dead_100h, herbs, woody = (value / 100 for value in damp)
    model = fuel_models.get_fuel_model(code)
    wet = fuel_models.moisturize(model, (dead_1h, dead_10h, dead_100h, 0.0, herbs, woody))
    still = surface_fire.calc_surface_fire_behavior_no_wind_no_slope(wet)
    rise = math.tan(math.radians(slope))
    fire = surface_fire.calc_surface_fire_behavior_max(still, speed * 60, bearing, rise, aspect)
    direction = vector_utils.spread_direction_vector_to_angle(fire["max_spread_direction"])
    size = fire["max_fireline_intensity"], fire["max_flame_length"]
    return fire["max_spread_rate"], direction, fire["length_to_width_ratio"], *size


@pytest.fixture(scope="module", params=["fbfm13", "fbfm40"])
def both(request):
    """Inputs, what we tell and what the witness tells, over a grid."""
    table = {"fbfm13": anderson_13, "fbfm40": scott_burgan_40}[request.param]()
    codes = sorted(set(table.codes.tolist()) - set(NOT_BURNABLE.values()))
    axes = (codes, DAMP, (0.0, 0.5, 2.0, 5.0, 12.0), (0.0, 77.0, 200.0), (0.0, 8.0, 25.0, 40.0), (0.0, 130.0, 260.0))
    grid = list(itertools.product(*axes))
    code, damp, speed, bearing, slope, aspect = (np.array(column) for column in zip(*grid, strict=True))
    water = dict(zip(MOISTURES, damp.T, strict=True))
    ours = rate_of_spread(code, request.param, (speed, bearing), slope, aspect, moisture=water, wind_height="midflame")
    return (speed > 0) | (slope > 0), ours, np.array([witness(*each) for each in grid])


@pytest.mark.parametrize("field", FIELDS)
def test_it_agrees_with_the_witness(both, field):
    _, ours, theirs = both
    told, expected = getattr(ours, field).numpy(), theirs[:, FIELDS[field]]
    assert (expected > 0.1).mean() > 0.5
    assert told[expected > 1e-4] == pytest.approx(expected[expected > 1e-4], rel=0.002)
    assert told[expected <= 1e-4] == pytest.approx(0.0, abs=1e-4), "it does not burn there"


def test_the_direction_is_that_of_the_witness(both):
    is_driven, ours, theirs = both
    turn = (ours.direction.numpy() - theirs[:, 1] + 180) % 360 - 180
    assert np.abs(turn[is_driven]) == pytest.approx(0.0, abs=0.2)
    assert (ours.direction.numpy()[~is_driven] == 0).all()


def test_the_witness_knows_the_same_fuel_models():
    codes = {*anderson_13().codes.tolist(), *scott_burgan_40().codes.tolist()}
    assert codes == set(fuel_models.list_fuel_model_numbers())


@pytest.mark.parametrize("cover, height", [(0, 0), (10, 20), (14.9, 20), (15.1, 20), (50, 1.5), (50, 9.144), (100, 40)])
def test_the_wind_at_midflame_height_is_that_of_the_witness(cover, height):
    water = dict(zip(MOISTURES, DAMP[1], strict=True))
    for code, row in ((101, 0.4), (145, 6.0), (181, 0.2)):
        midflame = surface_fire.calc_midflame_wind_speed(10.0, row, height / 0.3048, cover / 100)
        canopy = {"cover": cover, "height": height}
        ours = rate_of_spread(code, wind=(10.0, 30), moisture=water, wind_height="20ft", canopy=canopy)
        same = rate_of_spread(code, wind=(midflame, 30), moisture=water, wind_height="midflame")
        assert float(ours.head) == pytest.approx(float(same.head), rel=1e-4)
        high = rate_of_spread(code, wind=(11.5, 30), moisture=water, canopy=canopy)
        assert float(high.head) == pytest.approx(float(same.head), rel=1e-4)


def test_crown_fire_on_random_beds_is_that_of_the_witness():
    rows = {row["quantity"]: row for row in witness_errors(2000)}
    kind = rows.pop("kind of fire")
    assert kind["agree %"] == "100.00" and min(int(each.split()[0]) for each in kind["of them"].split(", ")) > 100
    assert len(rows) == 4 and all(float(row["largest difference %"]) < 1.0 for row in rows.values())
