"""Rates of line by hand."""

from dataclasses import replace

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.lines.production import BUILDERS, kinds_of, metres_a_minute


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
