"""What a team watches of the front, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.drawing import begun, later
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.mechanics.sensing.watching import memory_of
from warp_torchrl.world.team.team import Team

TWO_FIRES = "TTTTTTTTT TaTTTTTaT TTTTTTTTT"
WEST, MIDDLE, EAST = (1, 1), (1, 4), (1, 7)


def started(*at, sight, drawing=TWO_FIRES, worlds=1):
    world = small_world(team=Team(n_agents=len(at)), sensing=sight)
    return begun(world, *at, drawing=drawing, worlds=worlds), world


@pytest.mark.parametrize(
    ("at", "watches"),
    [
        ([WEST, EAST], [0.5, 0.5]),
        ([WEST, MIDDLE], [0.5, 0.0]),
        ([WEST, WEST], [0.25, 0.25]),  # who saw it in the same step shares it
        ([MIDDLE, MIDDLE], [0.0, 0.0]),
    ],
)
def test_the_front_is_watched_by_those_who_saw_it_last(at, watches):
    state, _ = started(*at, sight=Sight(radius=1))
    assert memory_of(state).watches[0].tolist() == watches
    assert memory_of(state).finds[0].tolist() == watches


def test_what_was_seen_lately_is_watched_and_what_was_seen_once_is_known():
    sight = Sight(radius=1, recent=1)
    state, world = started(WEST, sight=sight)
    assert memory_of(state).fronts.item() == 0 and memory_of(state).watched.item() == 0.0, "a start is no step"
    state = later(state, world, MIDDLE)
    assert memory_of(state).watches.item() == 0.5, "seen one step ago"
    state = later(state, world, MIDDLE)
    assert memory_of(state).watches.item() == 0.0
    memory = memory_of(state)
    assert (memory.watched.item(), memory.found.item(), memory.fronts.item()) == (0.5, 1.0, 2)


def test_a_cell_that_was_seen_before_it_burned_is_not_watched():
    sight = Sight(radius=1)
    state, world = started(MIDDLE, sight=sight)
    state = later(state, world, WEST, drawing="TTTTTTTTT TaTTaTTaT TTTTTTTTT")
    assert memory_of(state).watches.item() == pytest.approx(1 / 3)
    assert memory_of(state).found.item() == pytest.approx(1 / 3)


def test_a_fire_is_found_once_by_whom_nobody_went_before():
    sight = Sight(radius=1)
    state, world = started(WEST, MIDDLE, sight=sight)
    state = later(state, world, WEST, WEST, drawing="TTTTTTTTT aaTTTTTaT TTTTTTTTT")
    assert memory_of(state).finds[0].tolist() == pytest.approx([1 / 6, 1 / 6])  # one of three, by two
    again = later(state, world, WEST, WEST)
    assert memory_of(again).finds[0].tolist() == [0.0, 0.0]


def test_a_false_alarm_is_no_find():
    state, _ = started(MIDDLE, sight=Sight(radius=1, false_alarm=1.0))
    assert memory_of(state).finds.item() == 0.0 == memory_of(state).watches.item()


def test_uncertainty_is_what_the_team_has_not_seen_lately():
    sight = Sight(radius=1)
    state, world = started(WEST, sight=sight)
    assert memory_of(state).uncertain.item() == pytest.approx(1 - 9 / 27)
    state = later(state, world, MIDDLE)
    now = 1 - (9 + 9 * 16 / 17) / 27
    assert memory_of(state).uncertain.item() == pytest.approx(now) == memory_of(state).uncertainty.item()


def test_steps_without_a_front_do_not_count():
    sight = Sight(radius=1)
    state, world = started(WEST, sight=sight)
    state = later(state, world, WEST, drawing="TTTTTTTTT TeTTTTTTT TTTTTTTTT")
    assert memory_of(state).fronts.item() == 0 and memory_of(state).watches.item() == 0.0


def test_worlds_that_have_ended_are_watched_no_more():
    sight = Sight(radius=1)
    state, world = started(WEST, sight=sight, worlds=2)
    after = later(state, world, EAST, running=[True, False])
    assert memory_of(after).fronts.tolist() == [1, 0] and memory_of(after).finds[:, 0].tolist() == [0.5, 0.5]
    assert memory_of(after).uncertain[1] == memory_of(state).uncertain[1] != memory_of(after).uncertain[0]
    assert torch.equal(memory_of(after).itself[1], memory_of(state).itself[1])
