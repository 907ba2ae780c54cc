"""A wind that turns once."""

import pytest
from cold_front import ColdFront

from tests.world.drawing import draw
from warp_torchrl import make_env
from warp_torchrl.world.backends.tick import advance, in_wind
from warp_torchrl.world.law.fire import Fire


def test_it_turns_once_and_by_so_much() -> None:
    wind, seen = ColdFront(speed=3.0, direction=0.0, turn=90.0, at=2), []
    fire, state = Fire(), draw("..a..")
    state = in_wind(state, fire, wind(state.key, (1, 5)))
    for _ in range(4):
        state = advance(state, fire, wind, state.tick >= 0)
        seen.append(state.wind.flatten().tolist())
    east, north = pytest.approx([3.0, 0.0], abs=1e-6), pytest.approx([0.0, 3.0], abs=1e-6)
    assert seen == [east, north, north, north]


def test_it_is_a_wind_of_worlds() -> None:
    env = make_env("skirmish", n_worlds=1, plugins=["cold_front"], overrides=["wind=cold_front", "wind.at=6"])
    assert env.world.wind == ColdFront(at=6)


def test_a_front_before_the_first_tick_is_refused() -> None:
    with pytest.raises(ValueError, match="at must be in"):
        ColdFront(at=0)
