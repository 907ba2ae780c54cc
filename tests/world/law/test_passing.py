"""How a fire passed through a cell: its rate between those of the rear and the head, when it came."""

import pytest
import torch

from warp_torchrl.world.law.passing import HeadBehaviour, passing


@pytest.mark.parametrize("pace", [1.0, 2.0, 0.5])
def test_the_bounds_of_a_rate_move_with_the_pace_of_the_fire(pace):
    # 30 m in 5 minutes are 6 m/min; in 0.1 minute more than a head of 10 does, in 500 less than a rear of 0.718.
    # A pace of 2 doubles times: the head does 5 and the rear 0.359.
    then = HeadBehaviour(*(torch.full((3,), value) for value in (10.0, 0.718, 10_000.0, 2.0)))
    rate, intensity, flame = passing(torch.tensor([5.0, 0.1, 500.0]), torch.full((3,), pace), then, 30.0)
    head, rear = 10.0 / pace, 0.718 / pace
    assert rate.tolist() == pytest.approx([min(6.0, head), head, rear])
    share = rate / 10.0
    assert torch.allclose(intensity, 10_000.0 * share) and torch.allclose(flame, 2.0 * share.pow(0.46))


def test_the_kind_of_fire_on_arrival_is_that_of_the_head():
    then = HeadBehaviour(*torch.ones(4, 3), kind=torch.tensor([0.0, 1.0, 2.0]))
    *_, crowns, active = passing(torch.full((3,), 30.0), torch.ones(3), then, 30.0)
    assert crowns.tolist() == [0.0, 1.0, 1.0] and active.tolist() == [0.0, 0.0, 1.0]
