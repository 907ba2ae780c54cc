"""Worth that lies ahead of fires, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.heuristics.drawing import scene
from tests.world.drawing import draw
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.fires.ahead import worth_ahead
from warp_torchrl.world.law.arrivals import metric
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import rate_from


def house(*place, shape):
    worth = torch.zeros(shape)
    worth[(0, *place)] = 2.0
    return worth


def test_worth_counts_for_less_the_farther_it_is_and_not_beyond_what_cannot_burn():
    env, state = scene("aTTTTTTT ~~~~~~~~ aTTT.TTT ~~~~~~~~", at=[(0, 1)])
    state = state.replace(ground=state.ground.replace(alpha=state.alpha * 0 + 0.5))
    worth = house(0, 4, shape=(1, 4, 8)) + house(2, 5, shape=(1, 4, 8))
    # A house worth 2, four cells from the fire: 2 / 16. That behind the firebreak is never reached.
    found = worth_ahead(state, env.world, worth)[0]
    assert found[0, :6].tolist() == pytest.approx([0.125, 0.25, 0.5, 1.0, 0.5, 1.0])
    assert found[2, :4].tolist() == [0.0] * 4


def test_under_law_rate_it_counts_by_the_minutes_of_the_way_and_so_by_the_wind():
    fire = RateFire(cell_deviation=0.0, minutes_per_tick=1.0)
    world = small_world(fire=fire, wind=Uniform(speed=8.0))
    state = fire.started(draw("TTTTTT aTTTTT TTTTTT TTTTTT", fire=fire, wind=(8.0, 0.0)))
    east = 1.0 / rate_from(6, metric(state.ground, state.air))[0, 1, 2]  # minutes into a cell from the west
    found = worth_ahead(state, world, house(1, 3, shape=(1, 4, 6)), within=10.0)[0]
    assert found[1, 0].item() == pytest.approx(2.0 * (10.0 / (10.0 + east.item())) ** 3, rel=1e-5)
    assert found[1, 5] < found[1, 1], "against the wind"
