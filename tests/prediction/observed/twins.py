"""Twin experiments: a hidden fire of the same law, whose rate and wind the filter does not know."""

import torch

from warp_torchrl.prediction.observed.correction import Scene
from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.alone import on_map
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.weather.table import WeatherTable

CELL = 50.0


def scene(side=61, seed=0):
    """A fire in patches of two kinds of grass in a west wind."""
    draws = torch.Generator().manual_seed(seed)
    patches = torch.tensor([31, 31, 32])[torch.randint(3, (side // 8 + 1, side // 8 + 1), generator=draws)]
    fuel = patches.repeat_interleave(8, 0).repeat_interleave(8, 1)[:side, :side].to(torch.int16)
    cover = torch.full((1, side, side), 2, dtype=torch.uint8)
    table = WeatherTable(
        wind_speed=torch.tensor([3.0, 3.0]),
        wind_bearing=torch.tensor([270.0, 270.0]),
        ffmc=torch.tensor([91.0, 91.0]),
        hours=torch.tensor([0.0, 1.0]),
    )
    lit = torch.zeros(side, side, dtype=torch.bool)
    lit[side // 2, side // 3] = True
    return Scene(
        ground=Landscape(cover=cover, age=torch.full_like(cover, 10), elevation=None).with_layers(fuel=fuel[None]),
        cell_size=CELL,
        fire=RateFire(model="fbp", cell_deviation=0.1),
        air=Weather(table=table),
        start=0.0,
        lit=lit,
    )


def truth(of, rate, turn, seed, minutes):
    """When the hidden fire comes to each cell, float32 [H, W] [minutes]."""
    member = Members(torch.tensor([[rate, 1.0, 1.0, 1.0]]).log())
    member.values[0, 2] = turn
    fires = member.fires(of.fire, of.ground, of.spells(0.0, minutes), of.cell_size)
    return next(fires.in_parts(of.lit, world_key(torch.tensor([10_000 + seed])), on_map))[0]


def perimeters(arrival, *minutes):
    return [Observation(minutes=each, kind="perimeter", cells=arrival <= each) for each in minutes]
