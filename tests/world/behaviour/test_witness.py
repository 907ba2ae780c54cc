"""The package pyretechnics computes the same fires, for every fuel model over winds, slopes and moistures."""

import itertools
import math
import random

import numpy as np
import pytest

from warp_torchrl import rate_of_spread
from warp_torchrl.world.behaviour.standard_fuels import NOT_BURNABLE, anderson_13, scott_burgan_40

fuel_models = pytest.importorskip("pyretechnics.fuel_models", reason="needs the extra witness, and Python below 3.13")
from pyretechnics import burn_cells, surface_fire, vector_utils  # noqa: E402
from pyretechnics.space_time_cube import SpaceTimeCube  # noqa: E402

MOISTURES = ("dead_1h", "dead_10h", "dead_100h", "live_herbaceous", "live_woody")
WATER = {
    **{f"dead_{hours}h": f"fuel_moisture_dead_{hours}hr" for hours in (1, 10, 100)},
    **{f"live_{each}": f"fuel_moisture_live_{each}" for each in ("herbaceous", "woody")},
}
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


def crown_witness(bed):
    """Kind, rate [m/min], intensity [kW/m] and flame length [m] of the head on a bed of ``crown_beds``."""
    share = {"canopy_cover", "foliar_moisture", *WATER.values()}
    given = {name: value / 100 if name in share else value for name, value in bed.items()}
    given |= {"slope": math.tan(math.radians(bed["slope"])), "wind_speed_10m": 3.6 * bed["wind_speed_10m"]}
    cubes = {name: SpaceTimeCube((1, 1, 1), value) for name, value in given.items()}
    fire = burn_cells.burn_cell_as_head_fire(cubes, (0, 0, 0))
    return fire["fire_type"] - 1, fire["spread_rate"], fire["fireline_intensity"], fire["flame_length"]


def crown_beds(count, seed=0):
    """Random fuel beds under random canopies, by the names that the witness has for them."""
    draw = random.Random(seed)
    codes = sorted(set(scott_burgan_40().codes.tolist()) - set(NOT_BURNABLE.values()))
    for _ in range(count):
        height, dead = draw.uniform(3, 40), draw.uniform(2, 14)
        yield {
            "fuel_model": draw.choice(codes),
            "slope": draw.uniform(0, 40),
            "aspect": draw.uniform(0, 360),
            "wind_speed_10m": draw.uniform(0.5, 20),
            "upwind_direction": draw.uniform(0, 360),
            "canopy_cover": draw.uniform(30, 100),
            "canopy_height": height,
            "canopy_base_height": draw.uniform(0.0, 0.2) * height,
            "canopy_bulk_density": draw.uniform(0.01, 0.35),
            "foliar_moisture": draw.uniform(70, 130),
            "fuel_moisture_dead_1hr": dead,
            "fuel_moisture_dead_10hr": dead + 1,
            "fuel_moisture_dead_100hr": dead + 2,
            "fuel_moisture_live_herbaceous": draw.uniform(30, 120),
            "fuel_moisture_live_woody": draw.uniform(60, 150),
        }


def told_of_crowns(beds, **options):
    """What ``rate_of_spread`` tells of columns of ``crown_beds``."""
    crowns = ("cover", "height", "base_height", "bulk_density")
    canopy = {name: beds[f"canopy_{name}"] for name in crowns} | {"foliar_moisture": beds["foliar_moisture"]}
    water = {name: beds[theirs] for name, theirs in WATER.items()}
    wind = beds["wind_speed_10m"], beds["upwind_direction"]
    ground = beds["fuel_model"], "fbfm40", wind, beds["slope"], beds["aspect"]
    return rate_of_spread(*ground, moisture=water, canopy=canopy, **options)


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
    beds = list(crown_beds(2000))
    kind, *theirs = np.array([crown_witness(bed) for bed in beds]).T
    ours = told_of_crowns({name: np.array([bed[name] for bed in beds]) for name in beds[0]})
    assert (ours.kind.numpy() == kind).all() and np.bincount(kind.astype(int)).min() > 100
    for name, expected in zip(("head", "intensity", "flame_length"), theirs, strict=True):
        assert getattr(ours, name).numpy() == pytest.approx(expected, rel=0.01, abs=1e-4), name
