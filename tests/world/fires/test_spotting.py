"""Fires that embers start ahead of fires without vehicles."""

from typing import Any

import pytest
import torch
from torch import Tensor

from warp_torchrl.prediction.predict import predict
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state import window
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.weather.table import WeatherTable

CELL, WIND = 30.0, 12.0
BRANDS = Firebrands(per_heat=20.0, delay=5.0)


def across_a_river(height: int = 40, width: int = 128) -> tuple[Landscape, Tensor]:
    """C-2 on both sides of a river of three cells, and a fire in the west."""
    whole = torch.ones(1, height, width, dtype=torch.uint8)
    fuel, lit = whole.to(torch.int16) * 2, torch.zeros(height, width, dtype=torch.bool)
    fuel[:, :, 30:33] = 102
    lit[height // 2, 10] = True
    return Landscape(whole * 3, whole * 10, None).with_layers(fuel=fuel), lit


def arrivals(
    brands: Firebrands | None, fires: int = 2, minutes: float = 60.0, height: int = 24, width: int = 64
) -> Tensor:
    ground, lit = across_a_river(height, width)
    law = RateFire(model="fbp", cell_deviation=0.1)
    spells = [Spell(torch.tensor([WIND, 1.0]), minutes / 2), Spell(torch.tensor([WIND, -1.0]), minutes / 2)]
    burning = Fires(fire=law, landscape=ground, spells=spells, cell_size=CELL, embers=brands)
    return torch.cat(list(burning.in_parts(lit, world_key(torch.arange(fires)), on_map)))


def test_embers_start_fires_beyond_a_river_when_they_are_due() -> None:
    plain, jumped = arrivals(None), arrivals(BRANDS)
    assert (plain[:, :, 33:] == NEVER).all() and (plain[:, :, :30] < NEVER).any()
    beyond = jumped[:, :, 33:]
    assert (beyond < NEVER).flatten(1).any(1).all() and (jumped[:, :, 30:33] == NEVER).all()
    reached = plain[:, :, :30].where(plain[:, :, :30] > 0.0, NEVER).amin((1, 2))
    assert (beyond.amin((1, 2)) > reached + BRANDS.delay).all(), "a firebrand flies and smoulders first"
    assert (jumped <= 1.1 * plain).all(), "fires that join reach no cell later, but for the approximation of fronts"


def test_without_heat_for_any_nothing_changes_to_the_bit() -> None:
    plain = arrivals(None, minutes=40.0)
    for none in (Firebrands(per_heat=0.0), Firebrands(least_intensity=1e6)):
        assert torch.equal(plain, arrivals(none, minutes=40.0))
    assert not torch.equal(plain, arrivals(BRANDS, minutes=40.0)), "firebrands do change it"


def test_a_fire_is_the_same_in_any_window_and_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    wide: dict[str, Any] = {"height": 160, "width": 192, "minutes": 40.0}
    monkeypatch.setattr(window, "SIDE", 16)
    many = arrivals(BRANDS, **wide)
    assert torch.equal(many[:1], arrivals(BRANDS, fires=1, **wide))
    monkeypatch.setattr(window, "SIDE", 192)
    assert torch.equal(many, arrivals(BRANDS, **wide))


@pytest.mark.slow
def test_a_fire_that_has_burned_out_goes_on_where_an_ember_smoulders() -> None:
    ground, lit = across_a_river()
    island = Landscape(ground.cover, ground.age, None).with_layers(fuel=ground.layers.held["fuel"].clone())
    water = torch.ones(40, 33, dtype=torch.bool)
    water[18:23, 9:14] = False
    island.layers.held["fuel"][:, :, :33][:, water] = 102
    law, wind = RateFire(model="fbp", cell_deviation=0.0), Spell(torch.tensor([20.0, 0.0]), 300.0)
    late = Firebrands(per_heat=1e3, delay=240.0, decay=2000.0)
    fires = Fires(fire=law, landscape=island, spells=[wind], cell_size=CELL, embers=late)
    found = on_map(fires.burn(lit, world_key(torch.arange(1))))[0]
    west, east = (part[part < NEVER] for part in (found[:, :20], found[:, 33:]))
    assert west.max() < 235.0 and east.min() > 240.0


def test_a_prediction_has_them_where_asked() -> None:
    ground, lit = across_a_river()
    table = WeatherTable(hours=torch.tensor([0.0]), wind_speed=torch.tensor([WIND]), wind_bearing=torch.tensor([270.0]))
    plain, jumped = (
        predict(
            ground, table, lit, fire=RateFire(model="fbp"), cell_size=CELL, hours=0.75, fires=2, embers=each, seed=3
        )
        for each in (None, BRANDS)
    )
    assert plain.burn_probability[:, 33:].max() == 0.0 < jumped.burn_probability[:, 33:].max()
    assert torch.isfinite(jumped.rate[jumped.burn_probability > 0.0] + 0.0).sum() > 0
