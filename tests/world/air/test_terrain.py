"""Winds over hills in worlds: steady, drawn, and by the hour."""

import pytest
import torch

from warp_torchrl.world.air.hills import Hills, bent
from warp_torchrl.world.air.terrain import Terrain
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.burn import burn, start_burning
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

QUICK = Hills(layers=6, columns=64, iterations=5)
HILLY = Perlin(size=24, relief=80.0)
SEEDS = torch.arange(6)


def test_worlds_have_the_wind_that_their_hills_make_of_it() -> None:
    world = World(landscape=HILLY, wind=Terrain(speed=5.0, direction=90.0, hills=QUICK))
    state = world.reset(SEEDS, SEEDS * 0)
    ground = HILLY(state.key)
    factors = QUICK.factors(ground.elevation, 30.0)
    torch.testing.assert_close(state.wind, 5.0 * factors[:, 2:], atol=1e-5, rtol=0)
    assert state.wind.norm(dim=1).std() > 0.3


def test_each_episode_draws_its_speed_and_bearing() -> None:
    wind = Terrain(speed=(2.0, 8.0))(world_key(torch.arange(2000)), (5, 5))[..., 0, 0]
    speed = wind.norm(dim=1)
    assert speed.min() >= 2.0 and speed.max() <= 8.0
    # Uniform: mean 5, deviation 6 / sqrt(12) / sqrt(2000) = 0.039; five of them. Bearings do not follow from speeds.
    assert speed.mean() == pytest.approx(5.0, abs=0.2)
    assert torch.corrcoef(torch.stack((speed, wind[:, 1] / speed)))[0, 1].abs() < 0.12
    assert torch.equal(Terrain(speed=3.0)(SEEDS, (5, 5)), Uniform(speed=3.0)(SEEDS, (5, 5)))


def test_a_table_of_weather_blows_over_hills_by_the_hour() -> None:
    none = torch.full((1, 24, 24), 3, dtype=torch.uint8)
    land = Landscape(none, none, HILLY(world_key(SEEDS[:1])).elevation)
    wind = Terrain(path="august", minutes_per_tick=30.0, hills=QUICK)
    law = RateFire(minutes_per_tick=30.0)
    state = start_burning(land, wind=wind, fire=law, first_tick=0, stage_age=None, seed=0, cell_size=30.0)
    state = burn(state, law, wind, 7)
    expected = Weather(path="august", minutes_per_tick=30.0).after_tick(state)
    assert torch.equal(state.wind, bent(expected, QUICK.shaped(land, 30.0)))
    assert state.air.moisture is not None and wind.changes and not Terrain().changes


def test_ticks_of_law_rate_follow_from_the_wind_on_the_hills() -> None:
    plain, hilly = (
        World(landscape=HILLY, wind=wind, fire=RateFire()).fire.minutes
        for wind in (Uniform(speed=5.0, direction=0.0), Terrain(speed=5.0, direction=0.0, hills=QUICK))
    )
    assert hilly != plain


@pytest.mark.parametrize("options", [{"speed": 61.0}, {"speed": (5.0, 2.0)}, {"path": "no_such_file.csv"}])
def test_mistakes_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(ValueError):
        Terrain(**options)
