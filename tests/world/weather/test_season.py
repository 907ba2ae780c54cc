"""Growing season index and live moistures, by hand."""

import pytest
import torch

from warp_torchrl.world.weather.season import (
    curing_of,
    day_length,
    growing_season_index,
    live_moistures,
    season_index,
    vapour_pressure_deficit,
)


def test_a_day_is_twelve_hours_at_the_equator_and_sixteen_in_june_at_fifty_north():
    assert day_length(0.0, 100) == pytest.approx(12.0)
    # Declination 23.45: acos(-tan 50 tan 23.45) = acos(-0.51696) = 121.13 degrees, 16.15 hours
    assert day_length(50.0, 173) == pytest.approx(16.15, abs=0.02) and day_length(50.0, 356) == pytest.approx(
        7.85, abs=0.02
    )
    assert day_length(80.0, 173) == 24.0 and day_length(80.0, 356) == 0.0


def test_the_index_is_the_product_of_cold_drought_and_light():
    # (1.5 + 2) / 7 = 0.5, 1 - (2500 - 900) / 3200 = 0.5, 10.5 h - 10 h = 0.5
    half = [torch.tensor(each) for each in (1.5, 2500.0, 10.5)]
    assert float(growing_season_index(*half)) == pytest.approx(0.125)
    assert float(growing_season_index(torch.tensor(9.0), torch.tensor(500.0), torch.tensor(15.0))) == 1.0
    # At 25 C saturated air has 3161 Pa (Alduchov and Eskridge): at 40 % it lacks 1897.
    assert float(vapour_pressure_deficit(torch.tensor(25.0), torch.tensor(40.0))) == pytest.approx(1897.0, abs=3.0)


def test_moistures_rise_from_an_index_of_a_half_and_grass_is_cured_below():
    assert live_moistures(0.49) == (30.0, 60.0) and live_moistures(1.0) == (250.0, 200.0)
    assert live_moistures(0.75) == (140.0, 130.0)
    assert [curing_of(herbs) for herbs in (30.0, 75.0, 250.0)] == [100.0, 50.0, 0.0]


def test_the_index_is_the_mean_of_21_days_and_unknown_of_fewer():
    hours = torch.arange(-21.0 * 24.0, 6.0)
    mild, damp = torch.full_like(hours, 20.0), torch.full_like(hours, 80.0)
    mild[: 24 * 7] = -5.0  # of three weeks one is frozen
    assert season_index(hours, mild, damp, 180, 50.0) == pytest.approx(14.0 / 21.0)
    assert season_index(hours[24:], mild[24:], damp[24:], 180, 50.0) is None
