"""Rates of line by hand."""

from dataclasses import replace

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw
from warp_torchrl.world.behaviour.fuel_codes import FBP_CODES
from warp_torchrl.world.behaviour.standard_fuels import anderson_13, scott_burgan_40
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.lines.production import BUILDERS, kinds_of, metres_a_minute
from warp_torchrl.world.mechanics.lines.production import _numbers_of as numbers_of


def rates(fuel, percent, model="fbfm40"):
    """Metres a minute of crews of type 1 and 2, and of a bulldozer, on a slope in a fuel [m/min]."""
    fire = RateFire(model=model, minutes_per_tick=1.0)
    rise = [[30.0 * percent / 100.0 * column for column in range(5)]] * 5
    state = draw(" ".join(["TTTTT"] * 5), elevation=rise)
    codes = torch.full((1, 5, 5), fuel, dtype=torch.int16)
    state = state.replace(ground=replace(state.ground, landscape=state.landscape.with_layers(fuel=codes)))
    kind = kinds_of(state, small_world(fire=fire))[0, 2, 2]
    return [metres_a_minute(kind, torch.tensor(each)).item() for each in range(len(BUILDERS) + 1)]


def test_rates_are_those_of_the_tables():
    # 20.1168 m in a chain. Short grass, level: 30, 18, and (55 + 90 + 90 + 110) / 4 chains an hour.
    assert rates(102, 0.0) == pytest.approx([10.058, 6.035, 28.918, 0.0], abs=1e-3)
    # Litter with understory on 30 %: 6, 4, and (3 + 8 + 5 + 10) / 4.
    assert rates(165, 30.0) == pytest.approx([2.012, 1.341, 2.179, 0.0], abs=1e-3)
    assert rates(10, 30.0, "fbfm13") == rates(165, 30.0)
    assert rates(165, 80.0) == [0.0] * 4, "too steep for anybody"
    assert rates(2, 0.0, "fbp") == rates(165, 0.0), "boreal spruce"


def test_every_fuel_that_burns_has_a_rate():
    for model, table in (("fbfm13", anderson_13()), ("fbfm40", scott_burgan_40())):
        burns = table.fuels.load[:-1].sum(-1) > 0.0
        assert all(numbers_of(model)[code] for code in table.codes[burns].tolist()), model
    lacking = [code for code in FBP_CODES.tolist() if not numbers_of("fbp")[code]]
    assert lacking == [0, 99, *range(100, 107)], "those that do not burn"


def test_ground_of_an_unknown_fuel_has_that_of_its_cover():
    state = draw("TT TT", ground="gf wb")
    grass, forest, wetland, bare = kinds_of(state, small_world()).flatten().tolist()
    fuels = [each // 5 for each in (grass, forest, wetland, bare)]
    assert fuels == [1, 10, 8, 0]
