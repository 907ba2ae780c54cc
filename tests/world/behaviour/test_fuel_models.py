"""Fuel models, and tables of them."""

import pytest
import torch

from warp_torchrl.world.behaviour.fuel_models import FuelModel, fuel_table
from warp_torchrl.world.behaviour.standard_fuels import anderson_13, scott_burgan_40


def test_all_standard_models_are_there_under_the_codes_of_landfire():
    burns = [*range(101, 110), *range(121, 125), *range(141, 150), *range(161, 166), *range(181, 190), *range(201, 205)]
    assert scott_burgan_40().codes.tolist() == [91, 92, 93, 98, 99, *burns] and len(burns) == 40
    assert anderson_13().codes.tolist() == [*range(1, 14), 91, 92, 93, 98, 99]


def test_totals_are_those_of_the_publications():
    # Scott and Burgan 2005, table 7: SB1 1.50 + 3.00 + 11.00, GS4 1.90 + 0.30 + 0.10 + 3.40 + 7.10 short tons/acre.
    table = scott_burgan_40()
    total = table.fuels.load.sum(-1)[table.index(torch.tensor([201, 124]))] * 43560 / 2000
    assert total.tolist() == pytest.approx([15.5, 12.8], abs=0.005)
    # Albini 1976: 12 and 13 hold 1.587 and 2.668 lb/ft2.
    table = anderson_13()
    assert table.fuels.load.sum(-1)[table.index(torch.tensor([12, 13]))].tolist() == pytest.approx([1.587, 2.668])


def test_models_with_herbs_are_dynamic():
    table = scott_burgan_40()
    dynamic = {name for name, code in table.names.items() if table.fuels.dynamic[table.index(torch.tensor(code))]}
    assert dynamic == {*(f"GR{n}" for n in range(1, 10)), *(f"GS{n}" for n in range(1, 5)), "SH1", "SH9", "TU1", "TU3"}
    assert not anderson_13().fuels.dynamic.any()


def test_a_code_that_is_not_known_is_no_fuel():
    table = scott_burgan_40()
    row = table.index(torch.tensor([[-9999, 0, 100], [150, 205, 32767]], dtype=torch.int16))
    assert (row == len(table.codes)).all() and table.fuels.load[row].sum() == 0


def test_metric_units_are_converted():
    # 2.2417 t/ha are a short ton per acre; 65.617 /cm are 2000 /ft; 30.48 cm a foot; 18608 kJ/kg are 8000 Btu/lb.
    metric = {"units": "metric", "load_1h": 2.24170, "sav_1h": 65.6168, "depth": 30.48, "heat": 18608.0}
    model = FuelModel.of({**metric, "extinction_moisture": 25, "dynamic": True})
    assert model.loads == pytest.approx((1.0, 0, 0, 0, 0), rel=1e-4) and model.sav_1h == pytest.approx(2000, rel=1e-4)
    assert (model.depth, model.heat) == pytest.approx((1.0, 8000.0), rel=1e-4)
    assert model.extinction_moisture == 25 and model.dynamic and model.sav_live_woody == 1500


@pytest.mark.parametrize(
    "given, message",
    [
        ({"depth": 1.0}, "fuel model must have extinction_moisture, got depth"),
        ({}, "fuel model must have depth and extinction_moisture, got nothing"),
        ({"load_1hr": 1.0}, "fuel model must have fields of FuelModel, got 'load_1hr': did you mean load_1h"),
        ({"load_1h": -1.0}, r"load_1h must be in \[0, 200\], got -1"),
        ({"load_1h": "much"}, "load_1h must be a number, got 'much'"),
        ({"depth": 0.0, "load_1h": 1.0}, "depth and extinction_moisture must be above 0 where there is fuel"),
        ({"extinction_moisture": 120}, r"extinction_moisture must be in \[0, 100\], got 120"),
        ({"units": "imperial"}, "units of fuel model must be english or metric, got 'imperial'"),
        ({"dynamic": 3}, "dynamic must be true or false, got 3"),
    ],
)
def test_what_is_wrong_is_refused(given, message):
    whole = {"depth": 1.0, "extinction_moisture": 20.0}
    with pytest.raises(ValueError, match=message):
        FuelModel.of(given if "must have" in message and "fields" not in message else {**whole, **given})


def test_a_table_of_nothing_is_refused():
    with pytest.raises(ValueError, match="model must have at least one fuel model, got none"):
        fuel_table({})


def test_classes_of_one_size_share_their_weight():
    # Dead fuel of 1200 /ft and its cured grass of 1300 /ft are both 1200 /ft or more; 109 and 30 /ft stand alone.
    model = FuelModel(depth=1.0, extinction_moisture=20.0, sav_1h=1200, sav_live_herbaceous=1300, sav_live_woody=750)
    same = fuel_table({1: model}).fuels.same_size[0]
    expected = torch.eye(6)
    expected[0, 3] = expected[3, 0] = 1.0
    assert torch.equal(same, expected)


def test_ratios_of_standard_models_are_published_in_steps_of_50():
    for table in (scott_burgan_40(), anderson_13()):
        published = table.fuels.sav[:, [0, 3, 4]][:-1]
        assert (published % 50 == 0).all() and (published <= 3500).all()
