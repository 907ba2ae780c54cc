"""Rothermel's model: numbers worked out elsewhere, and what must hold for any fuel."""

import pytest
import torch

from warp_torchrl.world.behaviour.fuel_models import FuelModel, fuel_table
from warp_torchrl.world.behaviour.rothermel import bed_response, cured_load, live_extinction, moisture_damping
from warp_torchrl.world.behaviour.standard_fuels import NOT_BURNABLE, anderson_13, scott_burgan_40

LOW = torch.tensor([6.0, 7.0, 8.0, 60.0, 90.0])


def rows(table, *names):
    return table.index(torch.tensor([table.names[name] for name in names]))


def test_short_grass_by_hand():
    # Model 1 at 6 %: load 0.034 lb/ft2, ratio 3500 /ft, depth 1 ft, extinction 12 %, heat 8000 Btu/lb.
    #   packing            0.034 / 32 = 0.0010625; optimum 3.348 x 3500^-0.8189 = 0.0041933; relative 0.25338
    #   velocity           most 207063 / (495 + 0.0594 x 207063) = 16.1843; A = 133 x 3500^-0.7913 = 0.20867
    #                      16.1843 x 0.25338^0.20867 x exp(0.20867 x 0.74662) = 14.2060 /min
    #   damping            moisture 1 - 1.295 + 1.2775 - 0.44 = 0.5425; minerals 0.174 x 0.01^-0.19 = 0.41740
    #   intensity          14.2060 x 0.034 x 0.9445 x 8000 x 0.5425 x 0.41740 = 826.41 Btu/ft2/min
    #   flux               exp((0.792 + 0.681 x 59.161) x 0.1010625) / (192 + 0.2595 x 3500) = 0.057772
    #   sink               0.034 x exp(-138 / 3500) x (250 + 1116 x 0.06) = 10.3588 Btu/ft3
    #   rate               826.41 x 0.057772 / 10.3588 = 4.6090 ft/min = 1.4048 m/min
    #   heat per area      826.41 x 384 / 3500 = 90.669 Btu/ft2 = 1029.68 kJ/m2
    table = anderson_13()
    bed = bed_response(table.fuels.at(rows(table, "FM1")), LOW)
    assert float(bed.rate) == pytest.approx(1.4048, rel=1e-3)
    assert float(bed.heat) == pytest.approx(1029.68, rel=1e-3)
    assert float(bed.top_wind) == pytest.approx(0.9 * 826.41 * 0.3048, rel=1e-3)
    assert float(bed.wind_power) == pytest.approx(0.02526 * 3500**0.54, rel=1e-5)


def test_live_fuel_of_gs4_goes_out_where_behaveplus_says():
    # The tests of BehavePlus's core (firelab/behave) tell 137.968551 % for GS4 at these moistures.
    table = scott_burgan_40()
    fuels = table.fuels.at(rows(table, "GS4"))
    water = torch.tensor([0.06, 0.07, 0.08, 0.06, 0.60, 0.90])
    told = live_extinction(fuels, cured_load(fuels, torch.tensor(0.6)), water)
    assert float(told) == pytest.approx(1.37968551, rel=2e-3)


@pytest.mark.parametrize("herbs, cured", [(150, 0.0), (120, 0.0), (75, 0.5), (30, 1.0), (10, 1.0)])
def test_grass_cures_between_120_and_30_per_cent(herbs, cured):
    table = scott_burgan_40()
    fuels = table.fuels.at(rows(table, "GR2", "TU5"))
    load = cured_load(fuels, torch.tensor(herbs / 100.0))
    assert load[0, 3:5] == pytest.approx([0.0459 * cured, 0.0459 * (1 - cured)], abs=1e-6)
    assert load.sum(-1).tolist() == pytest.approx(fuels.load.sum(-1).tolist()), "curing moves load, and loses none"
    assert load[1, 3] == 0.0, "TU5 has no grass"


def test_static_models_do_not_cure():
    table = anderson_13()
    load = cured_load(table.fuels.at(rows(table, "FM2")), torch.tensor(0.3))
    assert load[0, 3:5] == pytest.approx([0.0, 0.023])


def test_moisture_damps_from_all_to_nothing():
    share = moisture_damping(torch.tensor([0.0, 0.15, 0.3, 0.5]), torch.tensor(0.3))
    assert share == pytest.approx([1.0, 0.5425, 0.0, 0.0], abs=1e-6)  # 1 - 1.295 + 1.2775 - 0.44 at a half


@pytest.mark.parametrize("table", [anderson_13(), scott_burgan_40()], ids=["13", "40"])
def test_what_is_no_fuel_does_not_burn_and_fuel_does(table):
    rate = bed_response(table.fuels, torch.tensor([3.0, 4.0, 5.0, 60.0, 90.0])).rate
    still = torch.isin(table.codes, torch.tensor(list(NOT_BURNABLE.values())))
    assert (rate[:-1][still] == 0).all() and rate[-1] == 0
    assert (rate[:-1][~still] > 0).all()


def test_nothing_at_all_spreads_past_the_moisture_of_extinction():
    for table in (anderson_13(), scott_burgan_40()):
        bed = bed_response(table.fuels, torch.tensor([45.0, 45.0, 45.0, 150.0, 150.0]))
        assert (bed.rate == 0).all() and (bed.heat == 0).all() and (bed.top_wind == 0).all()


@pytest.mark.parametrize("column", range(5))
def test_moister_fuel_spreads_no_faster(column):
    table = scott_burgan_40()
    wetter = LOW.clone()
    wetter[column] += 10.0
    before, after = (bed_response(table.fuels, each).rate for each in (LOW, wetter))
    if column == 3:  # what is no longer cured no longer burns as dead fuel, but a thinner dead bed is better packed
        table_at = rows(table, "GR1", "GR2", "GR4", "GS1", "SH1", "TU1")
        before, after = before[table_at], after[table_at]
    assert (after <= before * (1 + 1e-5)).all() and (after < before).any()


def test_rows_of_moisture_are_worlds():
    table = scott_burgan_40()
    damp = torch.stack((LOW, LOW + 3.0))
    both = bed_response(table.fuels, damp[:, None, :])
    assert both.rate.shape == (2, len(table.fuels.depth))
    for row, each in zip(damp, both.rate, strict=True):
        torch.testing.assert_close(bed_response(table.fuels, row).rate, each, rtol=1e-5, atol=0.0)


def test_gradients_by_moisture_are_those_of_differences():
    table = scott_burgan_40().to(dtype=torch.float64)
    moisture = LOW.double().requires_grad_()
    fields = ("rate", "heat", "wind_scale", "slope_scale", "top_wind")
    for name in fields:
        assert torch.autograd.gradcheck(lambda wet, name=name: getattr(bed_response(table.fuels, wet), name), moisture)


@pytest.mark.parametrize("moisture", [[3, 4, 5, 30, 30], [60, 60, 60, 120, 300], [1, 1, 1, 150, 1]])
def test_gradients_are_finite_for_every_fuel_and_none(moisture):
    for table in (anderson_13(), scott_burgan_40(), fuel_table({7: FuelModel(depth=1.0, extinction_moisture=20.0)})):
        wet = torch.tensor(moisture, dtype=torch.float32, requires_grad=True)
        bed = bed_response(table.fuels, wet)
        sum(getattr(bed, name).sum() for name in ("rate", "heat", "wind_scale", "top_wind")).backward()
        assert wet.grad.isfinite().all()
