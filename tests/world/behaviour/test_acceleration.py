"""Acceleration of young fires: ST-X-3 eqs. 70 to 72 by hand."""

import math

import pytest
import torch

from warp_torchrl.world.behaviour.acceleration import OPEN, mean_share, under_canopy
from warp_torchrl.world.behaviour.fbp import fbp_spread

AIR = {"wind_speed": 25 / 3.6, "wind_bearing": 270.0, "slope": 0.0, "aspect": 0.0, "ffmc": 92.0, "bui": 70.0}


def test_a_canopy_that_burns_by_a_half_slows_acceleration():
    # 18.8 * 0.5^2.5 * exp(-4) = 18.8 * 0.176777 * 0.0183156 = 0.060870
    assert under_canopy(torch.tensor([0.0, 0.5])).tolist() == pytest.approx([0.115, 0.054130], abs=1e-6)


def test_the_mean_share_makes_the_way_of_the_closed_form():
    # From a point D = R (t + exp(-a t) / a - 1 / a): at 20 minutes 20 + 0.87179 - 8.69565 = 12.17614 minutes of R.
    whole = 20.0 * float(mean_share(OPEN, 0.0, 20.0))
    parts = 5.0 * float(mean_share(OPEN, 0.0, 5.0)) + 15.0 * float(mean_share(OPEN, 5.0, 20.0))
    assert whole == pytest.approx(12.17614, abs=1e-4) and parts == pytest.approx(whole, abs=1e-4)


@pytest.mark.parametrize("code, is_open", [(1, True), (31, True), (2, False)])
def test_open_fuel_accelerates_at_0_115_and_a_burning_canopy_more_slowly(code, is_open):
    fuel = torch.tensor([code])
    steady, young = fbp_spread(fuel, **AIR), fbp_spread(fuel, **AIR, young=(19.999, 20.001))
    share = float(young.head / steady.head)
    usual = 1.0 - math.exp(-0.115 * 20.0)
    assert (share == pytest.approx(usual, abs=1e-3)) == is_open and share <= usual + 1e-3
    assert float(young.intensity / steady.intensity) == pytest.approx(share, rel=1e-5)
    assert float(young.flame_length / steady.flame_length) == pytest.approx(share**0.46, rel=1e-5)
