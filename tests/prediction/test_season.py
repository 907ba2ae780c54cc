"""Live fuel by place and date, where neither the law nor the weather tells it."""

from dataclasses import replace

import pytest
import torch

from warp_torchrl.prediction.season import Season
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.weather.table import WeatherTable

FBP = RateFire(model="fbp")


def weather(days=22, **columns):
    hours = torch.arange(24.0 * days)
    same = torch.ones_like(hours)
    began = (19905 - days + 1) * 24.0  # the last row's day is 2024-07-01
    return WeatherTable(
        hours=hours,
        wind_speed=same,
        wind_bearing=same,
        temperature=20.0 * same,
        humidity=60.0 * same,
        began=began,
        **columns,
    )


def season(days=22, **place):
    return Season(
        **{"latitude": 55.0, "longitude": -115.0, "elevation": 500.0, "start": 60.0 * 24.0 * (days - 1), **place}
    )


def test_canadian_foliar_moisture_and_leaves_are_those_of_the_date():
    # Normal latitude 43 + 33.7 exp(-0.0351 35) = 52.86, lowest 142.1 55 / 52.86 + 0.0172 500 = 156; 1 July is day 183:
    # 27 days after it 85 + 0.0189 27^2 = 98.8 %, and the leaves are not out.
    law, _, told = season(2)(FBP, weather(2))
    assert law.foliar_moisture == pytest.approx(98.78, abs=0.01) and law.green is False
    assert law.curing is None and "fire.curing 80 %, which no date tells" in told
    assert season(2, elevation=None, latitude=49.0)(FBP, weather(2))[0].green is True


def test_three_weeks_of_weather_tell_leaves_and_curing():
    # 20 C, 60 %: 2333 Pa lack 933, and the index is 1 - 33 / 3200 = 0.99: herbs 246 %, no grass is cured.
    law, _, told = season()(FBP, weather())
    assert law.green is True and law.curing == 0.0 and "index 0.99" in told


def test_what_the_user_or_the_weather_says_stays():
    given = replace(FBP, curing=30.0, green=False, foliar_moisture=110.0)
    assert season()(given, weather())[0] == given
    law = RateFire(moisture={"live_woody": 77.0})
    same, table, _ = season()(law, weather(live_herbaceous=torch.full((528,), 50.0)))
    assert same == law and table.live_woody is None and table.live_herbaceous[0] == 50.0
    assert season()(RateFire(), weather())[1].live_herbaceous[0] == pytest.approx(245.0, abs=3.0)


def test_places_and_tables_that_tell_nothing_are_refused_or_left():
    with pytest.raises(ValueError, match="season=date knows Canada and Alaska"):
        season(longitude=10.0)(FBP, weather())
    with pytest.raises(ValueError, match="season=date needs dates"):
        season()(FBP, replace(weather(), began=None))
    _, table, told = season(2)(RateFire(), weather(2))
    assert table.live_woody is None and "live moistures are those of fire.moisture" in told
