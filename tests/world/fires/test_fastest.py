"""Rows that stand for a large map where ticks are set."""

import math

import torch

from tests.world.backends.test_growing import land, lit, on_whole_map, turning
from warp_torchrl.world.air.fields import Lattice, WeatherFields
from warp_torchrl.world.air.sunlight import Sunlight
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires import fastest
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.fastest import RowsOfMap
from warp_torchrl.world.fires.spell import Spell, spread_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state import window
from warp_torchrl.world.state.window import Window


def fires(size, seed=3):
    return Fires(fire=RateFire(model="fbp"), landscape=land(seed, size), spells=turning(2), cell_size=30.0)


def test_a_large_map_is_asked_in_rows_evenly_apart(monkeypatch):
    monkeypatch.setattr(fastest, "_ASKED", 2000)
    monkeypatch.setattr(fastest, "_LEAST_FUEL", 10)
    asked, size = fires((90, 128)), (90, 128)
    # 11,520 cells are 5.8 times as many as asked, so every sixth row from the fourth on: 15 rows of 128
    whole, rows = asked.planes(1, Window.whole(size))[0, 3], torch.arange(3, 90, 6)
    heads = whole[rows][asked.fuel[rows]].sort(descending=True).values
    assert asked.fastest(1)[0] == heads[len(heads) - math.ceil(0.999 * len(heads))]


def test_small_maps_and_those_with_little_fuel_are_asked_as_a_whole(monkeypatch):
    assert RowsOfMap.of(land(3, (90, 128)), torch.ones(90, 128, dtype=torch.bool), 30.0) is None
    monkeypatch.setattr(fastest, "_ASKED", 2000)
    assert RowsOfMap.of(land(3, (90, 128)), torch.ones(90, 128, dtype=torch.bool), 30.0) is None, "1,920 of 4,096"
    monkeypatch.setattr(fastest, "_LEAST_FUEL", 1000)
    assert RowsOfMap.of(land(3, (90, 128)), torch.ones(90, 128, dtype=torch.bool), 30.0) is not None


def test_rows_have_the_weather_and_the_sunlight_of_their_place(monkeypatch):
    monkeypatch.setattr(fastest, "_ASKED", 2000)
    monkeypatch.setattr(fastest, "_LEAST_FUEL", 10)
    law, size = RateFire(model="fbfm40"), (90, 128)
    hills = land(3, size).with_layers(fuel=torch.full((1, *size), 102, dtype=torch.int16))
    level = torch.tensor([[4.0, 8.0], [20.0, 35.0]])
    dead = torch.stack((level, level + 1.0, level + 2.0, *level.new_full((4, 2, 2), torch.nan)))
    wind = torch.tensor([[3.0, 4.0], [5.0, 6.0]]).expand(1, 2, 2, 2)
    field = WeatherFields(Lattice((0.0, 89.0), (0.0, 127.0)), wind, dead[None]).at(0)
    mean = level.mean()
    fine = mean + torch.tensor([0.0, 2.0, 3.0])[:, None] * torch.arange(4.0)
    sunlight = Sunlight(fine, mean, dry=torch.tensor([[1.0, 1.0], [1.0, 0.0]]))
    row = torch.stack((mean, mean + 1.0, mean + 2.0, *torch.tensor([60.0, 90.0, 90.0, 60.0])))
    spell = Spell(wind.mean((0, 2, 3)), 60.0, row, field=field, sunlight=sunlight)
    rows = RowsOfMap.of(hills, torch.ones(size, dtype=torch.bool), 30.0)
    whole = spread_in(law, hills, 30.0, spell).head[0]
    assert torch.equal(rows.head(law, spell, 30.0), whole[torch.arange(3, 90, 6)]) and len(whole.unique()) > 1000


def test_fires_of_large_maps_come_to_the_times_of_the_whole_map_to_the_bit(monkeypatch):
    monkeypatch.setattr(window, "SIDE", 16)
    monkeypatch.setattr(fastest, "_ASKED", 2000)
    monkeypatch.setattr(fastest, "_LEAST_FUEL", 10)
    size, key = (90, 200), world_key(torch.arange(2))
    cells = lit(size, (40, 90))
    burning = fires(size)
    burning.landscape.layer("fuel")[0][cells] = 2
    found = burning.burn(cells, key)
    whole = on_whole_map(burning.fire, burning.landscape, cells, key, burning.spells)
    assert found.window.cells < 90 * 200 and torch.equal(on_map(found), whole)
