"""The cost of fire by hand."""

import pytest

from tests.env.reward.drawing import EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl.env.reward.alight import Alight


def test_each_step_costs_the_share_that_burns():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    # One of 16 trees burns; put out, none does.
    assert earned(Alight(cost=0.5, shaping=0.0), state, world, STAY, STAY) == pytest.approx([-0.5 / 16] * 2)
    assert earned(Alight(cost=0.5, shaping=0.0), state, world, EXTINGUISH, STAY) == [0.0, 0.0]


def test_a_negative_cost_is_refused():
    with pytest.raises(ValueError, match="cost must be in"):
        Alight(cost=-1.0)
