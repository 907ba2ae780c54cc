"""What people do to a world."""

import pytest

from warp_torchrl.demonstrations.events import Event, carry_out


def test_a_cell_that_is_not_there_is_told(match):
    with pytest.raises(ValueError, match="cell 16, 0 is not on the map of 16 x 16 cells"):
        carry_out(match.sides[0].env, Event(step=0, kind="ignite", numbers=(16.0, 0.0)))


def test_a_wind_out_of_its_range_changes_nothing(match):
    env = match.sides[0].env
    before = env.world
    with pytest.raises(ValueError, match="speed"):
        carry_out(env, Event(step=0, kind="blow", numbers=(1e9, 0.0)))
    assert env.world is before


@pytest.mark.parametrize(
    ("step", "kind", "numbers"), [(-1, "ignite", (0.0, 0.0)), (0, "jump", (0.0, 0.0)), (0, "clear", (0.0,))]
)
def test_what_is_no_event_is_refused(step, kind, numbers):
    with pytest.raises(ValueError, match="must"):
        Event(step=step, kind=kind, numbers=numbers)
