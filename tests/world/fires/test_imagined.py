"""Imagined worlds: other draws from now on, the same past."""

import torch

from tests.world.drawing import differing, draw
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.air.wind import Wandering
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.fires.imagined import imagined
from warp_torchrl.world.weather.table import WeatherTable
from warp_torchrl.world.world import World

STEADY = Wandering(speed_deviation=0.0, direction_deviation=0.0)


def test_what_is_imagined_draws_with_another_key() -> None:
    state = draw("aTT", worlds=4)
    ahead = imagined(state, state.key + 1, World())
    assert differing(ahead.replace(origin=None), state) == ["key"]
    assert torch.equal(imagined(ahead, state.key + 2, World()).episode_key, state.key), "and what is imagined in it"


def test_the_prevailing_wind_is_that_of_the_episode() -> None:
    state = draw("aTT", worlds=8)
    state = state.replace(air=state.air.replace(wind=STEADY(state.key, (1, 3))))
    torch.testing.assert_close(STEADY.after_tick(imagined(state, state.key + 1, World())), state.wind)


def test_the_weather_goes_on_from_the_hour_at_which_the_episode_began() -> None:
    hours = torch.arange(24.0)
    weather = Weather(table=WeatherTable(hours=hours, wind_speed=hours, wind_bearing=hours * 0), start=None)
    weather = weather.paced(60.0)
    state = draw("aTT", worlds=8)
    state = state.replace(tick=state.tick + 1)
    began = (uniform(state.key, 0, Stream.WEATHER, (1,))[:, 0] * 24).long()
    blown = weather.after_tick(imagined(state, state.key + 1, World())).flatten(1).norm(dim=1)
    torch.testing.assert_close(blown, (began + 1).clamp(max=23).float())
