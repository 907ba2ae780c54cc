"""From the wind of a station to the wind at midflame height."""

import pytest
import torch

from warp_torchrl.world.behaviour.wind_adjustment import open_factor, wind_adjustment_factor


def factor(depth=1.0, cover=0.0, height=0.0, ratio=1.0):
    return float(wind_adjustment_factor(*(torch.tensor(float(each)) for each in (depth, cover, height, ratio))))


def test_open_fuel_beds_of_the_publication():
    # The known factors of models 1, 5 and 4, of 1, 2 and 6 ft, in the open (Andrews 2012).
    told = open_factor(torch.tensor([1.0, 2.0, 6.0, 0.0]))
    assert told.tolist() == pytest.approx([0.36, 0.42, 0.55, 0.0], abs=0.01)


def test_a_closed_canopy_by_hand():
    # 60 % cover, 60 ft, crown ratio 0.5: a share of 0.1 is filled; ln((20 + 21.6) / 7.8) = 1.6740;
    # 0.555 / (sqrt(6) x 1.6740) = 0.1354
    assert factor(cover=60, height=60 * 0.3048, ratio=0.5) == pytest.approx(0.1354, abs=2e-4)
    assert factor(depth=6.0, cover=60, height=18, ratio=0.5) == factor(depth=1.0, cover=60, height=18, ratio=0.5)


@pytest.mark.parametrize("cover, height, ratio", [(14, 20, 1.0), (100, 1.8, 1.0), (60, 20, 0.2)])
def test_few_low_or_short_crowns_do_not_shelter(cover, height, ratio):
    assert factor(cover=cover, height=height, ratio=ratio) == factor()


def test_a_denser_canopy_lets_less_wind_through():
    factors = [factor(cover=cover, height=15) for cover in (0, 20, 50, 100)]
    assert factors == sorted(factors, reverse=True) and factors[-1] < 0.15


def test_gradients_are_finite_without_a_canopy():
    given = [torch.tensor(each, requires_grad=True) for each in (0.0, 0.0, 0.0, 1.0)]
    wind_adjustment_factor(*given).backward()
    assert all(each.grad.isfinite() for each in given)


def test_crowns_shelter_from_15_per_cent_on():
    # A share of 0.05 is filled, 40 ft: 0.555 / (sqrt(2) ln((20 + 14.4) / 5.2)) = 0.2077, where it is 0.36 in the open
    assert factor(cover=15, height=40 * 0.3048) == pytest.approx(0.2077, abs=1e-4)
    assert factor(cover=30, height=40 * 0.3048, ratio=0.5) == factor(cover=15, height=40 * 0.3048)
    assert factor(cover=14.9, height=40 * 0.3048) == factor()
