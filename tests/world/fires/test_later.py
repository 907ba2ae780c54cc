"""Cells that are lit after the start."""

import pytest
import torch

from tests.world.backends.test_growing import land, lit, turning
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state import window

SIZE = (100, 220)


def burned(places, start=((30, 40),)):
    """Two fires over an hour and a half in even fuel, with cells that are lit at their minutes."""
    ground = land(1, SIZE, relief=False).with_layers(fuel=torch.full((1, *SIZE), 2, dtype=torch.int16))
    later = torch.full(SIZE, torch.inf)
    for place, minutes in places.items():
        later[place] = minutes
    law = RateFire(model="fbp", cell_deviation=0.2)
    fires = Fires(fire=law, landscape=ground, spells=turning(3), cell_size=30.0, later=later)
    return on_map(fires.burn(lit(SIZE, *start), world_key(torch.arange(2))))


def test_a_cell_burns_from_its_time_on_in_any_window(monkeypatch):
    monkeypatch.setattr(window, "SIDE", 16)
    found = burned({(70, 180): 47.3, (20, 120): 10.0})
    assert found[:, 70, 180].tolist() == pytest.approx([47.3, 47.3]), "to the minute, not to the tick"
    about = found[:, 60:81, 170:191]
    assert bool((about >= 47.29).all()) and int((about < NEVER).sum()) > 20
    monkeypatch.setattr(window, "SIDE", 220)
    assert torch.equal(found, burned({(70, 180): 47.3, (20, 120): 10.0}))


def test_where_the_fire_has_come_before_nothing_changes():
    plain = burned({})
    cell = tuple((plain[0] < 40.0).nonzero()[-1].tolist())
    assert torch.equal(burned({cell: 80.0})[0], plain[0])


def test_a_fire_may_begin_after_the_start():
    found = burned({(50, 100): 35.0}, start=())
    assert float(found.min()) == 35.0 and int((found < NEVER).sum()) > 20
