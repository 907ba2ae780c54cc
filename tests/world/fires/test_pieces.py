"""Spells in pieces: fires that accelerate, and winds with gusts."""

import pytest
import torch

from tests.prediction.test_predict import SIDE, ground, lit, weather
from warp_torchrl import fire_history
from warp_torchrl.prediction.predict import predict
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.pieces import Gusts, from_ignition, gust_factors
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire

LAW = {"model": "fbp", "cell_deviation": 0.0}
EAST = torch.tensor([4.0, 0.0])


def burned(fire=None, hours=1.0, **options):
    return predict(
        ground(), options.pop("table", weather(270.0, 270.0)), lit(), fire=fire or RateFire(**LAW), fires=1,
        cell_size=20.0, hours=hours, **options,
    )  # fmt: skip


def test_pieces_cover_the_spells_and_tell_the_fires_age():
    made = from_ignition([Spell(EAST, 12.0), Spell(EAST, 300.0)])
    assert [piece.minutes for piece in made] == [5, 5, 2, 3, 5, 10, 15, 15, 30, 30, 60, 60, 72]
    assert made[2].young == (10.0, 12.0) and made[-2].young == (180.0, 240.0) and made[-1].young is None


def test_an_accelerated_fire_comes_when_the_closed_form_says():
    steady, young = burned(), burned(RateFire(**LAW, acceleration=True))
    row, a = SIDE // 2, 0.115
    told = []
    for column in range(row + 4, row + 16, 3):
        minutes = young.arrival_minutes[row, column]  # O-1a is open: T = t + exp(-a t) / a - 1 / a
        told.append(float(minutes + torch.exp(-a * minutes) / a - 1.0 / a))
    assert told == pytest.approx([float(steady.arrival_minutes[row, c]) for c in range(row + 4, row + 16, 3)], rel=0.02)
    assert young.area[0, -1] < 0.9 * steady.area[0, -1]


def test_a_fire_that_burned_before_does_not_accelerate():
    one, other = (burned(RateFire(**LAW, acceleration=each), is_seen=True) for each in (False, True))
    assert torch.equal(one.half_minutes.nan_to_num(-1.0), other.half_minutes.nan_to_num(-1.0))


def test_worlds_that_step_refuse_acceleration():
    with pytest.raises(ValueError, match=r"fire\.acceleration must be false in worlds that step"):
        fire_history(
            cells=ground().age, cover=ground().cover, ticks=1, wind=(1.0, 0.0),
            fire=RateFire(**LAW, acceleration=True), fuel=ground().layer("fuel"),
        )  # fmt: skip


def test_draws_have_the_mean_of_the_wind_and_end_at_the_gust():
    factors = gust_factors(world_key(torch.arange(20_000)), Spell(EAST, 10.0, gust=1.6, block=3))
    # Standard deviation (1.6 - 1) / 2.4 = 0.25, before the gust cuts off one in a hundred
    assert float(factors.mean()) == pytest.approx(1.0, abs=0.01) and float(factors.std()) == pytest.approx(
        0.25, abs=0.015
    )
    assert float(factors.max()) == pytest.approx(1.6) and float(factors.min()) > 0.2
    other = gust_factors(world_key(torch.arange(20_000)), Spell(EAST, 10.0, gust=1.6, block=4))
    assert abs(float(torch.corrcoef(torch.stack((factors, other)))[0, 1])) < 0.03


def test_rows_with_gusts_are_cut_and_others_are_not():
    made = Gusts(minutes=20.0).blocks([Spell(EAST, 60.0, gust=1.5), Spell(EAST, 60.0)])
    assert [(each.minutes, each.block) for each in made] == [(20, 0), (20, 1), (20, 2), (60, 3)]
    assert len(Gusts(factor=2.0).blocks([Spell(EAST, 60.0)])) == 6


def test_fires_in_gusts_differ_and_need_gusts_to_be_told():
    found = predict(
        ground(), weather(270.0), lit(), fire=RateFire(**LAW), fires=6, cell_size=50.0, hours=1.0,
        gusts=Gusts(factor=1.8, minutes=30.0),
    )  # fmt: skip
    again = predict(
        ground(), weather(270.0), lit(), fire=RateFire(**LAW), fires=3, seed=3, cell_size=50.0, hours=1.0,
        gusts=Gusts(factor=1.8, minutes=30.0),
    )  # fmt: skip
    assert len(set(found.final_area.tolist())) == 6 and torch.allclose(
        found.final_area[3:], again.final_area, rtol=0.02
    )
    with pytest.raises(ValueError, match="gusts needs a column of gusts"):
        burned(gusts=Gusts())
