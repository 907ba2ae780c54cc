"""How a fire passed through a cell: its rate between those of the rear and the head, in the weather of its arrival."""

import pytest
import torch

from warp_torchrl.prediction.passing import Behaviour, passing
from warp_torchrl.rates.spread import Spread
from warp_torchrl.world.travel import NEVER


def heads(*rates, ratio=2.0):
    """A spell of an hour for each rate, on a map of one row of three cells."""
    plane = torch.ones(1, 1, 3)
    spreads = [
        Spread(
            head=plane * rate,
            direction=plane * 0.0,
            length_to_breadth=plane * ratio,
            intensity=plane * 1000.0 * rate,
            flame_length=plane * 2.0,
        )
        for rate in rates
    ]
    return Behaviour.of(spreads, [60.0] * len(rates))


def rates_of(times, behaviour, pace=1.0):
    arrival = torch.tensor([[times]])
    return passing(arrival, torch.full_like(arrival, pace), behaviour, 30.0)


def test_the_rear_goes_slower_by_the_eccentricity():
    # Of length to breadth 2, e^2 = 3 / 4: (1 - e) / (1 + e) = 0.0718
    assert heads(10.0).backing[0].tolist() == pytest.approx([0.718] * 3, abs=1e-3)
    assert torch.equal(heads(10.0, ratio=1.0).backing, heads(10.0).head), "a round fire has no rear"


@pytest.mark.parametrize("pace", [1.0, 2.0, 0.5])
def test_the_bounds_of_a_rate_move_with_the_pace_of_the_fire(pace):
    # 30 m in 5 minutes are 6 m/min; in 0.1 minute more than a head of 10 does, in 500 less than its rear, 0.718.
    # A pace of 2 doubles times: the head does 5 and the rear 0.359.
    rate, intensity, flame = rates_of([0.0, 5.0, 5.1], heads(10.0), pace)
    head, rear = 10.0 / pace, 0.718 / pace
    assert rate[0, 0].tolist() == pytest.approx([0.0, min(6.0, head), head], rel=1e-3)
    slow = rates_of([0.0, 500.0, 501.0], heads(10.0), pace)[0]
    assert float(slow[0, 0, 1]) == pytest.approx(rear, rel=1e-3)
    share = rate / 10.0
    assert torch.allclose(intensity, 10_000.0 * share) and torch.allclose(flame, 2.0 * share.pow(0.46))


def test_the_weather_is_that_of_the_hour_in_which_the_fire_came():
    # 6 m/min are more than a head of 2: the bound tells the hour of a cell. The last minute is the hour's own.
    behaviour = heads(2.0, 4.0)
    for minute, bound in ((59.0, 2.0), (60.0, 2.0), (60.5, 4.0), (119.0, 4.0), (130.0, 4.0)):
        rate = rates_of([minute - 5.0, minute, NEVER], behaviour)[0]
        assert float(rate[0, 0, 1]) == pytest.approx(bound), minute


def test_where_fire_did_not_come_or_was_lit_it_has_no_rate():
    for each in rates_of([0.0, NEVER, NEVER], heads(10.0)):
        assert each.tolist() == [[[0.0, 0.0, 0.0]]]
