"""Flames by the way that a front goes: the head's along the wind, the rear's against it."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.law.flames import (
    flames_of,
    front_towards,
    heat_of,
    intensity,
    metric_at,
    strongest_into,
    weakest_way_out,
)
from warp_torchrl.world.law.passing import head_behaviour
from warp_torchrl.world.law.rate import RateFire

FIRE = RateFire(cell_deviation=0.0, minutes_per_tick=1.0)
MIDDLE = torch.tensor([[4]])


def field(**options):
    return draw("TTT TaT TTT", fire=FIRE, **options)


def test_a_front_has_the_intensity_of_the_head_along_the_wind_and_of_the_rear_against_it():
    state = field(wind=(3.0, 4.0))
    head = FIRE.head_at(state, MIDDLE)
    then = head_behaviour(head)
    heat, metric, size = heat_of(FIRE, state)[:, 1, 1][None], metric_at(state, MIDDLE), 30.0
    ways = {name: torch.tensor([[way]]) for name, way in (("east", 3.0), ("north", 4.0), ("none", 0.0))}
    along = intensity(heat, metric, ways["east"], ways["north"], size)
    against = intensity(heat, metric, -ways["east"], -ways["north"], size)
    assert along.item() == pytest.approx(head.intensity.item(), rel=1e-4)
    assert intensity(heat, metric, ways["none"], ways["none"], size).item() == pytest.approx(along.item(), rel=1e-4)
    assert against.item() == pytest.approx((then.intensity * then.backing / then.head).item(), rel=1e-4)
    assert (heat * head.head[0] / 60.0).item() == pytest.approx(along.item(), rel=1e-4)


def test_fronts_towards_places_and_into_cells_are_those_of_the_way():
    north, south = torch.tensor([[[0, 1]]]), torch.tensor([[[2, 1]]])
    state = field(wind=(0.0, 8.0))
    heat = heat_of(FIRE, state)
    ahead, behind = (front_towards(state, heat, 0.0, MIDDLE, place) for place in (north, south))
    assert ahead.item() > 4.0 * behind.item() > 0.0, "the wind blows to the north"
    into = strongest_into(state, heat, 0.0, torch.tensor([[1, 7, 4]]))
    assert into[0].tolist() == pytest.approx([ahead.item(), behind.item(), 0.0])
    assert strongest_into(state, None, 9.0, torch.tensor([[1, 4]])).tolist() == [[9.0, 0.0]]
    assert front_towards(state, None, 9.0, MIDDLE, north).tolist() == [[9.0]]


def test_the_weakest_way_out_is_against_the_wind_where_it_is_open():
    state = field(wind=(9.0, 0.0))
    heat, ways = heat_of(FIRE, state), torch.ones(1, 3, 3, dtype=torch.bool)
    against = torch.tensor([[-1.0]]), torch.tensor([[0.0]])
    rear = intensity(heat[:, 1, 1][None], metric_at(state, MIDDLE), *against, 30.0).item()
    assert weakest_way_out(state, heat, ways, MIDDLE[0]).item() == pytest.approx(rear)
    ways[0, :, 0] = False
    sideways = torch.tensor([[0.0]]), torch.tensor([[1.0]])
    flank = intensity(heat[:, 1, 1][None], metric_at(state, MIDDLE), *sideways, 30.0).item()
    assert weakest_way_out(state, heat, ways, MIDDLE[0]).item() == pytest.approx(flank)
    assert flank > rear
    assert weakest_way_out(state, heat, ~ways.any() & ways, MIDDLE[0]).item() == float("inf")


def test_nothing_burns_without_fuel():
    state = draw("T~ TT", fire=FIRE)
    assert heat_of(FIRE, state)[0, 0].tolist() == [pytest.approx(2753.0, rel=1e-3), 0.0]


def test_flame_lengths_are_those_of_byram_in_decimetres():
    exact = torch.tensor([0.0, 100.0, 1000.0, 5000.0, 1e7])
    assert flames_of(exact).tolist() == pytest.approx([0.0, 0.6, 1.8, 3.8, 25.5], abs=0.11)
    assert torch.allclose(flames_of(exact[:4]), 0.0775 * exact[:4].pow(0.46) - 0.05, atol=0.051)
