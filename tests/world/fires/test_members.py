"""Members of an ensemble: their winds, their moistures, and fires that burn as each would alone."""

import math

import pytest
import torch

from tests.world.backends.test_growing import land, lit, turning
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.behaviour.moistures import MOISTURES, moisture_row
from warp_torchrl.world.ensemble.parameters import Deviations
from warp_torchrl.world.fires import alone
from warp_torchrl.world.fires import members as members_module
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.sectors import SECTORS
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.window import Window


def member(rate=1.0, wind_speed=1.0, bearing=0.0, moisture=1.0):
    return [math.log(rate), math.log(wind_speed), bearing, math.log(moisture)]


def test_the_wind_turns_clockwise_and_grows():
    # A wind to the north, turned by a quarter, goes east; twice as fast
    east, south = Members(torch.tensor([member(1.0, 2.0, 90.0), member(1.0, 1.0, 180.0)])).winds(
        torch.tensor([0.0, 3.0])
    )
    assert east.tolist() == pytest.approx([6.0, 0.0], abs=1e-5) and south.tolist() == pytest.approx(
        [0.0, -3.0], abs=1e-5
    )
    assert Members(torch.tensor([member(bearing=90.0)])).winds(torch.tensor([3.0, 0.0]))[0].tolist() == pytest.approx(
        [0.0, -3.0], abs=1e-5
    ), "a wind to the east goes south"


def test_dead_fuel_is_wetter_and_so_is_the_code_of_fine_fuel():
    row = Members(torch.tensor([member(moisture=1.5)])).moistures(moisture_row({}))[0]
    at = list(MOISTURES).index("ffmc")
    assert row[:3].tolist() == pytest.approx([9.0, 10.5, 12.0]) and row[3:at].tolist() == [60.0, 90.0]
    # FFMC 90 is (14875 - 13248) / 149.5 = 10.88 %; half more is 16.32 %, and the code 59.5 * 233.68 / 163.52 = 85.03
    assert float(row[at]) == pytest.approx(85.03, abs=0.01)


def test_a_member_of_no_change_has_the_weather_as_given():
    row = moisture_row({})
    assert torch.allclose(Members.plain().moistures(row)[0], row, atol=1e-4)


def test_drawn_members_have_the_deviations_asked_for():
    found = Members.drawn(
        world_key(torch.arange(4000)),
        Deviations(rate=0.4, wind_speed=0.2, bearing=15.0, moisture=0.0, held=0.1),
        lit((20, 20), (10, 10)),
    )
    assert float(found.rate.median()) == pytest.approx(1.0, abs=0.03)
    assert float(found.rate.std() / found.rate.mean()) == pytest.approx(0.4, abs=0.03)
    assert float(found.bearing.std()) == pytest.approx(15.0, abs=0.6) and bool((found.moisture == 1.0).all())
    assert float(found.held.float().mean()) == pytest.approx(0.1, abs=0.01)
    assert float(found.local.log().std()) == pytest.approx(0.27, abs=0.02), "0.29, of draws within two deviations"


def test_members_burn_as_each_does_alone_together_and_in_parts(monkeypatch):
    size, fire = (41, 64), RateFire(model="fbp", cell_deviation=0.2)
    ground, cells, key = land(1, size), lit(size, (20, 30)), world_key(torch.arange(4))
    members = Members(torch.tensor([member(), member(0.7), member(1.5, 1.3, 40.0), member(1.0, 0.6, -30.0, 1.4)]))
    fires = members.fires(fire, ground, turning(2, minutes=8.0), 30.0)
    single = torch.cat([on_map(fires.of(slice(one, one + 1)).burn(cells, key[one : one + 1])) for one in range(4)])
    for at_once, parts in ((64, 1), (2, 2)):
        monkeypatch.setattr(alone, "AT_ONCE", at_once)
        found = list(fires.in_parts(cells, key, on_map))
        assert len(found) == parts and torch.allclose(torch.cat(found), single, rtol=1e-4, atol=1e-3)
    areas = (single < NEVER / 2).flatten(1).sum(1)
    assert areas[1] < areas[0] < areas[2]


def test_a_held_sector_stays_and_others_burn_at_rates_of_their_own():
    size, fire = (40, 64), RateFire(model="fbp", cell_deviation=0.0)
    ground, cells = land(1, size), lit(size, (20, 32))
    sector = (torch.arange(64) > 32).long().expand(size)
    rates, held = torch.ones(1, SECTORS), torch.zeros(1, SECTORS, dtype=torch.bool)
    rates[0, 1], held[0, 0] = 2.0, True
    values = torch.zeros(1, 4)

    def burned(members):
        return on_map(members.fires(fire, ground, turning(1), 30.0).burn(cells, world_key(torch.arange(1))))[0]

    plain, uneven = burned(Members(values)), burned(Members(values, rates, held, sector))
    assert float(uneven[20, 34]) == pytest.approx(0.5 * float(plain[20, 34]), rel=1e-3)
    assert bool((uneven[:, :32] == NEVER).all())
    masked = Members(values, rates, held, sector).stopped(burned(Members(values, rates, None, sector))[None])[0]
    assert bool((masked[:, :32] == NEVER).all()) and torch.equal(masked[:, 33:], uneven[:, 33:])


def test_the_pace_is_the_rate_of_heads_over_that_of_the_given_weather():
    size, fire = (40, 64), RateFire(model="fbp")
    spell, window = turning(1)[0], Window.whole(size)
    found = Members(torch.tensor([member(), member(1.5), member(1.0, 2.0)])).pace(
        fire, land(1, size), spell, 30.0, window
    )
    assert found[:2].tolist() == pytest.approx([1.0, 1.5], rel=1e-5) and float(found[2]) > 1.1


def test_a_fire_that_is_seen_is_half_a_cell_ahead():
    size, fire = (40, 64), RateFire(model="fbp", cell_deviation=0.0)
    ground = land(1, size, relief=False).with_layers(fuel=torch.full((1, *size), 2, dtype=torch.int16))
    cells, half_way = lit(size, (20, 20)), lit(size, (20, 21))
    times = [
        on_map(Members.plain().fires(fire, ground, turning(1), 30.0, half).burn(cells, world_key(torch.arange(1))))[0]
        for half in (None, half_way)
    ]
    assert float(times[1][20, 21]) == pytest.approx(0.5 * float(times[0][20, 21]))
    assert float(times[1][20, 23]) == pytest.approx(float(times[0][20, 23]) * 2.5 / 3.0, rel=0.02)


def test_members_that_differ_in_rate_alone_have_one_factor_in_each_part_of_its_distribution():
    members = Members.by_rate(world_key(torch.arange(101)), 0.4)
    rates = members.rate.sort().values
    assert rates[50] == pytest.approx(1.0, abs=1e-6) and not bool(members.values[:, 1:].any())
    assert float(rates.std() / rates.mean()) == pytest.approx(0.4, abs=0.02)
    assert not torch.equal(members.rate, rates), "keys order them"


def test_members_of_like_rates_burn_in_ticks_of_their_own(monkeypatch):
    monkeypatch.setattr(members_module, "AT_ONCE", 2)
    members = Members(torch.tensor([member(1.2), member(0.5), member(3.0), member(0.6)]))
    order = members.by_pace()
    assert order.tolist() == [1, 3, 0, 2], "slow ones, then swift ones, each in their order"
    sorted_members = members.part(order)
    size, fire = (41, 64), RateFire(model="fbp", cell_deviation=0.2)
    fires = sorted_members.fires(fire, land(1, size), turning(2, minutes=8.0), 30.0, in_paces=True)
    assert fires.swift.tolist() == pytest.approx([0.6, 0.6, 3.0, 3.0])
    cells, key = lit(size, (20, 30)), world_key(order)
    parts = list(fires.in_parts(cells, key, on_map))
    assert [len(part) for part in parts] == [2, 2]
    assert fires.of(slice(0, 2)).spell(0).ticks < fires.of(slice(2, 4)).spell(0).ticks
    monkeypatch.setattr(alone, "AT_ONCE", 1)
    assert torch.equal(torch.cat(list(fires.in_parts(cells, key, on_map))), torch.cat(parts))
