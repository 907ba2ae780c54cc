"""Crown fire: when it starts, how fast it is, how hot, and what it leaves of the surface fire."""

import csv
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import torch

from warp_torchrl import rate_of_spread
from warp_torchrl.world.behaviour.crown import (
    critical_intensity,
    critical_rate,
    crown_length_to_breadth,
    cruz_active_rate,
    cruz_rate,
)
from warp_torchrl.world.behaviour.spread import Spread

LOW = {"dead_1h": 6, "dead_10h": 7, "dead_100h": 8, "live_herbaceous": 60, "live_woody": 90}
TREES = {"cover": 70.0, "height": 20.0, "base_height": 1.0, "bulk_density": 0.15}
CROWN_FIRES = Path(__file__).parents[4] / "shared" / "fires" / "crown_fires.csv"


def ask(fuel="TU5", wind=10.0, canopy=TREES, moisture=LOW, **options):
    return rate_of_spread(fuel, wind=(wind, 270.0), moisture=moisture, canopy=canopy, **options)


def number(function, *given):
    return [float(each) for each in torch.as_tensor(function(*map(torch.tensor, given))).flatten()]


def test_the_equations_by_hand():
    # (0.01 * 2 * (460 + 26 * 100))^1.5 = 61.2^1.5 = 478.8 kW/m; without a gap below the crowns any fire is enough.
    assert number(critical_intensity, [2.0, 0.0], 100.0) == pytest.approx([478.77, 0.0], rel=1e-4)
    assert number(critical_rate, 0.15) == pytest.approx([20.0])
    # 11.02 * 36^0.9 * 0.15^0.19 * exp(-0.17 * 5) = 11.02 * 25.158 * 0.69736 * 0.42741
    assert number(cruz_active_rate, [36.0, 0.0], 0.15, 5.0) == pytest.approx([82.636, 0.0], rel=1e-4)
    # At 20 mph over the trees, 1.15 times that at 10 m: 1 + 0.125 * 20; 8 at most.
    assert number(crown_length_to_breadth, [20 * 1.15 * 0.44704, 90.0]) == pytest.approx([3.5, 8.0])


def test_a_fire_too_slow_for_its_crowns_is_passive_and_slower():
    # R = 11.02 * 10^0.9 * 0.05^0.19 * exp(-0.17 * 8) = 12.717, below 3 / 0.05 = 60: 12.717 exp(-12.717 / 60) = 10.288
    rate, is_active = cruz_rate(*map(torch.tensor, (10.0, 0.05, 8.0)))
    assert not is_active and float(rate) == pytest.approx(10.288, rel=1e-4)
    rate, is_active = cruz_rate(*map(torch.tensor, (10.0, 0.3, 8.0)))  # 17.87 against 10
    assert is_active and float(rate) == pytest.approx(float(cruz_active_rate(*map(torch.tensor, (10.0, 0.3, 8.0)))))


@pytest.mark.parametrize("change", [{"cover": 40.0}, {"bulk_density": 0.0}, {"base_height": 19.0}])
@pytest.mark.parametrize("crown", ["cruz", "rothermel"])
def test_where_crowns_do_not_burn_the_fire_is_that_of_the_surface_to_the_bit(change, crown):
    canopy = {**TREES, **change}
    sheltered = {name: canopy[name] for name in ("cover", "height")}
    surface, told = ask(canopy=sheltered), ask(canopy=canopy, crown=crown)
    assert all(torch.equal(getattr(told, each.name), getattr(surface, each.name)) for each in fields(Spread))
    assert told.kind == 0.0


def test_ground_without_fuel_has_no_crown_fire():
    told = ask(["NB1", "TU5"], canopy={**TREES, "base_height": 0.0})
    assert told.kind.tolist() == [0.0, 2.0] and told.head[0] == told.intensity[0] == 0.0


def test_kinds_rates_and_heat():
    winds = torch.tensor([0.2, 2.0, 10.0])
    surface, told = ask(wind=winds, crown="none"), ask(wind=winds)
    assert told.kind.tolist() == [0.0, 1.0, 2.0] and surface.kind.tolist() == [0.0] * 3
    active = float(cruz_active_rate(*map(torch.tensor, (36.0, 0.15, 6.0))))
    assert float(told.head[2]) == pytest.approx(active, rel=1e-5) and told.head[2] > surface.head[2]
    # The surface's heat and 0.15 kg/m3 * 19 m * 18608 kJ/kg of the crowns, at the rate of the head:
    heat = surface.intensity[2] / surface.head[2] * 60 + 0.15 * 19 * 8000 * 2.326
    assert float(told.intensity[2]) == pytest.approx(float(heat) * active / 60, rel=1e-5)
    assert float(told.flame_length[2]) == pytest.approx(0.0775 * float(told.intensity[2]) ** 0.46, rel=1e-5)
    assert float(told.length_to_breadth[2]) == pytest.approx(1 + 0.125 * 10 / 1.15 / 0.44704, rel=1e-5)


def test_a_surface_fire_faster_than_its_crowns_keeps_its_rate_and_burns_them():
    canopy = {**TREES, "base_height": 0.1}
    surface, told = ask("SB4", wind=0.1, canopy=canopy, crown="none"), ask("SB4", wind=0.1, canopy=canopy)
    assert told.kind == 1.0 and told.head == surface.head and told.length_to_breadth == surface.length_to_breadth
    assert told.intensity > surface.intensity


def test_rothermels_crown_fire_is_3_34_times_fuel_model_10():
    ten = rate_of_spread(10, "fbfm13", (10.0 * 0.4 / 1.15, 270.0), moisture=LOW, wind_height="midflame")
    told = ask(crown="rothermel")
    assert told.kind == 2.0 and float(told.head) == pytest.approx(3.34 * float(ten.head), rel=1e-5)
    passive = ask(crown="rothermel", canopy={**TREES, "bulk_density": 0.05})
    assert passive.kind == 1.0 and passive.head == ask(crown="none").head, "as fast as the surface fire"


def test_dry_needles_ignite_before_wet_ones():
    kinds = [float(ask(wind=5.0, canopy={**TREES, "foliar_moisture": water}).kind) for water in (60, 90, 180)]
    assert kinds == [2.0, 2.0, 0.0]


def test_the_wind_at_20_ft_is_that_at_10_m_of_the_crowns():
    assert float(ask(wind_height="20ft").head) == pytest.approx(float(ask(wind=11.5).head), rel=1e-5)


@pytest.mark.parametrize("crown", ["cruz", "rothermel"])
def test_gradients_are_finite_even_in_calm(crown):
    wind = torch.tensor([0.0, 3.0, 10.0], requires_grad=True)
    dead = torch.tensor(4.0, requires_grad=True)
    told = ask(wind=wind, moisture={**LOW, "dead_1h": dead}, canopy={**TREES, "base_height": 0.0}, crown=crown)
    (told.head.sum() + told.intensity.sum() + told.flame_length.sum()).backward()
    assert wind.grad.isfinite().all() and dead.grad < 0.0 and wind.grad[2] > 0.0


@pytest.mark.skipif(not CROWN_FIRES.is_file(), reason=f"the observed crown fires are not at {CROWN_FIRES}")
def test_observed_crown_fires():
    with CROWN_FIRES.open(newline="") as file:
        rows = list(csv.DictReader(file))[1:]  # the first row holds units
    seen = {name: torch.tensor([float(row[name]) for row in rows]) for name in rows[0]}
    rate = cruz_active_rate(seen["U_10"], seen["CBD"], seen["M"])
    wrong = (rate - seen["ROS"]).abs()
    assert len(rows) == 57 and int((wrong <= 0.35 * seen["ROS"]).sum()) >= 31
    assert float(wrong.mean()) <= 15.5
    through_all = rate_of_spread(
        np.full(57, 165),
        wind=(seen["U_10"] / 3.6, 0.0),
        moisture={**LOW, "dead_1h": seen["M"]},
        canopy={"cover": 60, "height": 15, "base_height": 0.0, "bulk_density": seen["CBD"]},
    )
    is_active = through_all.kind == 2.0
    torch.testing.assert_close(through_all.head[is_active], rate[is_active])
    assert int(is_active.sum()) >= 50
