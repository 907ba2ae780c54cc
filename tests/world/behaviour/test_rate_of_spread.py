"""The public call: what it takes, what it refuses."""

import numpy as np
import pytest
import torch

from warp_torchrl import rate_of_spread
from warp_torchrl.world.behaviour.fuel_codes import FBP_NAMES
from warp_torchrl.world.behaviour.fuel_models import FuelModel

LOW = {"dead_1h": 6, "dead_10h": 7, "dead_100h": 8, "live_herbaceous": 60, "live_woody": 90}
HEATH = {"depth": 1.0, "extinction_moisture": 25, "load_1h": 1.5, "load_live_woody": 2.0, "sav_1h": 2200}
TREES = {"cover": 50, "height": 20}
FIELDS = ("head", "direction", "length_to_breadth", "intensity", "flame_length")


def ask(fuel=102, **options):
    return rate_of_spread(fuel, **{"wind": (5.0, 270.0), "moisture": LOW, **options})


def test_a_number_gives_numbers():
    told = ask()
    for name in FIELDS:
        assert getattr(told, name).shape == () and getattr(told, name).dtype == torch.float32
    assert float(told.direction) == pytest.approx(90.0) and told.head > 1.0


@pytest.mark.parametrize(
    "kind",
    [list, tuple, np.array, torch.tensor, lambda codes: np.array(codes, np.float32)],
    ids=["list", "tuple", "array", "tensor", "floats"],
)
def test_every_kind_of_sequence_tells_the_same(kind):
    told = ask(kind([102, 99, 165]))
    single = [float(ask(code).head) for code in (102, 99, 165)]
    assert told.head.tolist() == pytest.approx(single, rel=1e-6) and single[1] == 0.0


def test_what_does_not_burn_has_no_rate_intensity_or_flame():
    for model in ("fbfm13", "fbfm40"):
        told = ask([91, 92, 93, 98, 99], model=model, slope=20, aspect=10)
        assert told.head.tolist() == told.intensity.tolist() == told.flame_length.tolist() == [0.0] * 5
        assert told.length_to_breadth.tolist() == [1.0] * 5 and told.direction.isfinite().all()


def test_inputs_broadcast_to_one_shape():
    fuel = np.array([[101, 102, 103], [141, 142, 143]])
    told = ask(fuel, wind=(torch.rand(4, 1, 1) * 5, 10.0), slope=np.arange(3), moisture={**LOW, "dead_1h": [[5], [9]]})
    assert all(getattr(told, name).shape == (4, 2, 3) for name in FIELDS)
    one = ask(141, wind=(0.0, 10.0), slope=2.0, moisture={**LOW, "dead_1h": 9})
    calm = ask(fuel, wind=(0.0, 10.0), slope=np.arange(3), moisture={**LOW, "dead_1h": [[5], [9]]})
    assert calm.head[1, 0] != one.head and calm.head.shape == (2, 3)
    assert ask(fuel[:0]).head.shape == (0, 3)


def test_moisture_by_cell_tells_what_moisture_for_all_does():
    fuel = np.array([102, 122, 165, 203])
    by_cell = ask(fuel, moisture={name: np.full(4, value) for name, value in LOW.items()})
    for name in FIELDS:
        torch.testing.assert_close(getattr(by_cell, name), getattr(ask(fuel), name), rtol=1e-5, atol=0.0)


@pytest.mark.parametrize(
    "model, names, codes",
    [
        ("fbfm40", ["GR2", "tu5", "NB1", "SB4"], [102, 165, 91, 204]),
        ("fbfm13", ["FM1", "FM13", "NB9"], [1, 13, 99]),
    ],
)
def test_fuels_have_names(model, names, codes):
    assert torch.equal(ask(names, model=model).head, ask(codes, model=model).head)
    assert ask(names[0], model=model).head.shape == ()
    assert ask(np.array([names, names]), model=model).head.shape == (2, len(names))


def test_thicker_dead_fuel_is_a_little_moister_where_nothing_is_said():
    short = {name: LOW[name] for name in ("dead_1h", "live_herbaceous", "live_woody")}
    assert torch.equal(ask([122, 203], moisture=short).head, ask([122, 203]).head)  # 6 + 1 and 6 + 2 are those of LOW
    damp = {**short, "dead_10h": 20}
    assert (ask([122, 203], moisture=damp).head < ask([122, 203]).head).all()


def test_live_moisture_is_asked_for_where_there_is_live_fuel():
    assert ask("TL3", moisture={"dead_1h": 6}).head > 0
    assert ask(["TU5", "TL3"], moisture={"dead_1h": 6, "live_woody": 90}).head.shape == (2,)
    with pytest.raises(ValueError, match="moisture must have live_herbaceous where fuels have such a load"):
        ask(["TL3", "GR2"], moisture={"dead_1h": 6})


def test_the_height_of_the_wind_matters():
    heights = [float(ask(wind_height=height).head) for height in ("10m", "20ft", "midflame")]
    assert heights == sorted(heights) and heights[0] < 0.95 * heights[1] < 0.95 * heights[2]
    same = ask(wind=(5.75, 270.0))  # 5 m/s at 20 ft are 5.75 m/s at 10 m
    assert float(same.head) == pytest.approx(heights[1], rel=1e-5)
    trees = {"cover": 60, "height": 15}
    assert ask(canopy=trees).head < ask().head
    assert ask(canopy={**trees, "crown_ratio": 0.4}).head > ask(canopy=trees).head, "short crowns let more wind through"


def test_own_fuel_models_by_code():
    told = ask([3, 7], model={3: FuelModel(**HEATH), "7": HEATH})
    assert told.head[0] == told.head[1] > 0
    table = {1: {"depth": 1.0, "extinction_moisture": 12, "load_1h": 0.74, "sav_1h": 3500}}
    assert float(ask(1, model=table).head) == pytest.approx(float(ask(1, model="fbfm13").head), rel=2e-3)


def test_gradients_flow_back_to_wind_slope_and_moisture():
    given = [torch.tensor(value, requires_grad=True) for value in (0.0, 0.0, 6.0)]
    speed, slope, dead = given
    told = ask([102, 165, 99], wind=(speed, 0.0), slope=slope, moisture={**LOW, "dead_1h": dead})
    sum(getattr(told, name).sum() for name in FIELDS).backward()
    assert all(each.grad.isfinite().all() for each in given) and dead.grad < 0


def test_arrays_that_cannot_be_written_are_read_without_a_warning(recwarn):
    fuel = np.array([102, 122])
    fuel.flags.writeable = False
    ask(fuel, slope=fuel / 20.0)
    assert not [each for each in recwarn if "writable" in str(each.message)]


REFUSED = [
    ({"fuel": [102, 7, 300]}, "fuel must be codes of fbfm40, got 7, 300"),
    ({"fuel": list(range(20, 40))}, "fuel must be codes of fbfm40, got 20, 21, 22, 23, 24, ..."),
    ({"fuel": [102.0, float("nan")]}, "fuel must be codes of fbfm40, got nan"),
    ({"fuel": 102.5}, "fuel must be codes of fbfm40, got 102.5"),
    ({"fuel": "GR22"}, "fuel must be names of fbfm40, got 'GR22': did you mean"),
    ({"fuel": None}, "fuel must be codes or names of fuels, got None"),
    ({"fuel": 8, "model": {7: HEATH}}, "fuel must be codes of the given fuel models, got 8"),
    ({"model": "fbfm14"}, "model must be fbfm13, fbfm40, fbp or fuel models by code, got 'fbfm14': did you mean"),
    ({"model": {}}, "model must have at least one fuel model, got none"),
    ({"model": {"x": HEATH}}, "model must have whole numbers as codes of fuel models, got 'x'"),
    ({"model": {7: 3}}, "fuel model 7 must be a FuelModel or a mapping of its fields, got 3"),
    ({"wind": 5.0}, "wind must be a speed and a bearing, got 5.0"),
    ({"wind": (-1.0, 0.0)}, "wind speed must be in [0, 150], got -1"),
    ({"wind": (1.0, float("nan"))}, "wind bearing must be in [-720, 720], got nan"),
    ({"wind": ("fast", 0.0)}, "wind speed must be numbers, got 'fast'"),
    ({"slope": [10, 90]}, "slope must be in [0, 89], got 90"),
    ({"aspect": 9999}, "aspect must be in [-720, 720], got 9999"),
    ({"moisture": {**LOW, "dead_1h": 0.06}}, "moisture.dead_1h must be in [1, 300], got 0.06"),
    ({"moisture": {**LOW, "dead1h": 6}}, "got 'dead1h': did you mean dead_1h"),
    ({"moisture": {"dead_10h": 6, "live_herbaceous": 60}}, "moisture must have dead_1h, got dead_10h, live_herbaceous"),
    ({"moisture": 6}, "moisture must be a mapping of per cent by name, got 6"),
    ({"wind_height": "10 m"}, "wind_height must be 10m, 20ft, midflame, got '10 m'"),
    ({"canopy": {"cover": 50}}, "canopy must have height, got cover"),
    ({"canopy": {"height": 20, "crown_ratio": 0.5}}, "canopy must have cover, got height, crown_ratio"),
    ({"canopy": {**TREES, "base_height": 2}}, "canopy must have bulk_density, got cover, height, base_height"),
    ({"canopy": {**TREES, "density": 0.1}}, "bulk_density, foliar_moisture, got 'density'"),
    ({"canopy": {**TREES, "bulk_density": 12, "base_height": 2}}, "canopy.bulk_density must be in [0, 2], got 12"),
    ({"canopy": 50}, "canopy must be a mapping of numbers by name, got 50"),
    ({"canopy": TREES, "wind_height": "midflame"}, "canopy must be left out where wind_height is midflame, got one"),
    ({"crown": "van_wagner"}, "crown must be cruz, rothermel, none, got 'van_wagner'"),
    ({"fuel": [101, 102], "slope": [1, 2, 3]}, "shapes must broadcast to one, got fuel (2,), slope (3,)"),
    ({"model": "fbp", "fuel": 2, "wind_height": "midflame"}, "moisture must have some of ffmc, bui for this model"),
]


@pytest.mark.parametrize("given, message", REFUSED, ids=[message[:40] for _, message in REFUSED])
def test_what_is_wrong_is_refused_in_one_line(given, message):
    with pytest.raises(ValueError) as refusal:
        ask(**given)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)


# The Canadian system

CODES = {"ffmc": 90, "bui": 60}


@pytest.fixture
def canadian():
    return pytest.importorskip("warp_torchrl.world.behaviour.fbp", reason="the Canadian rates are not there yet")


def test_the_canadian_system_is_asked_by_the_same_call(canadian):
    told = ask(["C-2", "O-1a"], model="fbp", moisture=CODES, slope=10, aspect=45)
    wind = {"wind_speed": torch.tensor(5.0), "wind_bearing": torch.tensor(270.0)}
    ground = {"slope": torch.tensor(10.0), "aspect": torch.tensor(45.0)}
    weather = {"ffmc": torch.tensor(90.0), "bui": torch.tensor(60.0)}
    same = canadian.fbp_spread(torch.tensor([2, 31]), **wind, **ground, **weather)
    assert all(torch.equal(getattr(told, name), getattr(same, name)) for name in FIELDS)
    low = ask(["C-2", "O-1a"], model="fbp", moisture=CODES, wind=(5.0 / 1.15, 270.0), wind_height="20ft")
    assert low.head.tolist() == pytest.approx(ask([2, 31], model="fbp", moisture=CODES).head.tolist(), rel=1e-4)


def test_every_canadian_name_is_a_fuel_that_burns(canadian):
    told = ask(list(FBP_NAMES), model="fbp", moisture={"ffmc": 92, "bui": 120})
    assert (told.head > 0).all()


@pytest.mark.parametrize(
    "given, message",
    [
        ({"wind_height": "midflame"}, "wind_height must be 10m or 20ft for fbp"),
        ({"canopy": TREES}, "canopy must be left out for fbp"),
        ({"moisture": {"ffmc": 90}}, "moisture must have bui for fbp, got ffmc"),
        ({"fuel": [2, 10]}, "fuel must be codes of fbp, got 10"),
        ({"fuel": "C-8"}, "fuel must be names of fbp, got 'C-8': did you mean"),
    ],
)
def test_what_the_canadian_system_does_not_read_is_refused(canadian, given, message):
    with pytest.raises(ValueError) as refusal:
        ask(**{"fuel": 2, "model": "fbp", "moisture": CODES, **given})
    assert message in str(refusal.value)
