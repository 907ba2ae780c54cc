"""Fires that take two neighbours, by hand."""

import pytest
import torch
from threshold import Threshold

from tests.world.drawing import draw, drawn
from warp_torchrl import make_env
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.backends.tick import advance


def test_threshold_fires_fill_corners_and_leave_what_one_neighbour_burns() -> None:
    fire = Threshold(probability=1.0)
    state = draw("aTT aTT TTT", fire=fire)
    # Two cells burn in the west: only the trees beside both ignite.
    assert fire.spread_probability(state)[0].tolist() == [[0, 1, 0], [0, 1, 0], [0, 0, 0]]
    assert fire.expected_ignitions(state)[0, 0, 0].item() == 2.0
    assert drawn(advance(state, fire, Calm(), torch.tensor([True]))) == "baT baT TTT"


def test_it_is_a_law_of_worlds() -> None:
    env = make_env("skirmish", n_worlds=2, plugins=["threshold"], overrides=["fire=threshold", "fire.least=3"])
    assert env.world.fire == Threshold(least=3)
    env.rollout(4, break_when_any_done=False)


def test_a_threshold_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="least must be in"):
        Threshold(least=9)
