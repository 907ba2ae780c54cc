"""What a team watches of the front, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import CELLS, codes, draw
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.mechanics.sensing.watching import watching_of
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.radio import Radio
from warp_torchrl.world.team.team import Team

TWO_FIRES = "TTTTTTTTT TaTTTTTaT TTTTTTTTT"
WEST, MIDDLE, EAST = (1, 1), (1, 4), (1, 7)


def started(*at, sight, drawing=TWO_FIRES, worlds=1, carries="none"):
    team = Team(n_agents=len(at), radio=Radio(carries=carries))
    return sight.begun(draw(drawing, team=team, at=list(at), worlds=worlds), team), team


def later(state, team, *at, sight, drawing=None, running=True):
    """The worlds a step later, the team at other places, and perhaps other cells."""
    cells = state.cells if drawing is None else codes(drawing, CELLS).expand_as(state.cells)
    position = torch.tensor(at).expand_as(state.vehicles.position)
    state = state.replace(cells=cells, step=state.step + 1, vehicles=state.vehicles.replace(position=position))
    return sight.updated(state, team, torch.as_tensor(running).expand_as(state.done))


@pytest.mark.parametrize(
    ("at", "watches"),
    [
        ([WEST, EAST], [0.5, 0.5]),
        ([WEST, MIDDLE], [0.5, 0.0]),
        ([WEST, WEST], [0.25, 0.25]),  # who saw it in the same step shares it
        ([MIDDLE, MIDDLE], [0.0, 0.0]),
    ],
)
@pytest.mark.parametrize("carries", ["none", "map"])  # who was told of it has no part
def test_the_front_is_watched_by_those_who_saw_it_last(at, watches, carries):
    state, _ = started(*at, sight=Sight(radius=1), carries=carries)
    assert watching_of(state).watches[0].tolist() == watches
    assert watching_of(state).finds[0].tolist() == watches


def test_what_was_seen_lately_is_watched_and_what_was_seen_once_is_known():
    sight = Sight(radius=1, recent=1)
    state, team = started(WEST, sight=sight)
    assert watching_of(state).fronts.item() == 0 and watching_of(state).watched.item() == 0.0, "a start is no step"
    state = later(state, team, MIDDLE, sight=sight)
    assert watching_of(state).watches.item() == 0.5, "seen one step ago"
    state = later(state, team, MIDDLE, sight=sight)
    assert watching_of(state).watches.item() == 0.0
    watching = watching_of(state)
    assert (watching.watched.item(), watching.found.item(), watching.fronts.item()) == (0.5, 1.0, 2)


def test_the_credit_passes_to_who_sees_it_again():
    sight = Sight(radius=1)
    state, team = started(WEST, MIDDLE, sight=sight, carries="map")
    state = later(state, team, MIDDLE, WEST, sight=sight)
    assert watching_of(state).watches[0].tolist() == [0.0, 0.5] and watching_of(state).finds[0].tolist() == [0.0, 0.0]


def test_a_cell_that_was_seen_before_it_burned_is_not_watched():
    sight = Sight(radius=1)
    state, team = started(MIDDLE, sight=sight)
    state = later(state, team, WEST, sight=sight, drawing="TTTTTTTTT TaTTaTTaT TTTTTTTTT")
    assert watching_of(state).watches.item() == pytest.approx(1 / 3)
    assert watching_of(state).found.item() == pytest.approx(1 / 3)


def test_a_fire_is_found_once_by_whom_nobody_went_before():
    sight = Sight(radius=1)
    state, team = started(WEST, MIDDLE, sight=sight)
    state = later(state, team, WEST, WEST, sight=sight, drawing="TTTTTTTTT aaTTTTTaT TTTTTTTTT")
    assert watching_of(state).finds[0].tolist() == pytest.approx([1 / 6, 1 / 6])  # one of three, by two
    again = later(state, team, WEST, WEST, sight=sight)
    assert watching_of(again).finds[0].tolist() == [0.0, 0.0]


def test_a_false_alarm_is_no_find():
    state, _ = started(MIDDLE, sight=Sight(radius=1, false_alarm=1.0))
    assert watching_of(state).finds.item() == 0.0 == watching_of(state).watches.item()


def test_uncertainty_is_what_the_team_has_not_seen_lately():
    sight = Sight(radius=1)
    state, team = started(WEST, sight=sight)
    assert watching_of(state).uncertain.item() == pytest.approx(1 - 9 / 27)
    state = later(state, team, MIDDLE, sight=sight)
    now = 1 - (9 + 9 * 16 / 17) / 27
    assert watching_of(state).uncertain.item() == pytest.approx(now) == watching_of(state).uncertainty.item()


def test_steps_without_a_front_do_not_count():
    sight = Sight(radius=1)
    state, team = started(WEST, sight=sight)
    state = later(state, team, WEST, sight=sight, drawing="TTTTTTTTT TeTTTTTTT TTTTTTTTT")
    assert watching_of(state).fronts.item() == 0 and watching_of(state).watches.item() == 0.0


def test_worlds_that_have_ended_are_watched_no_more():
    sight = Sight(radius=1)
    state, team = started(WEST, sight=sight, worlds=2)
    after = later(state, team, EAST, sight=sight, running=[True, False])
    assert watching_of(after).fronts.tolist() == [1, 0] and watching_of(after).finds[:, 0].tolist() == [0.5, 0.5]
    assert watching_of(after).uncertain[1] == watching_of(state).uncertain[1] != watching_of(after).uncertain[0]
    assert torch.equal(watching_of(after).itself[1], watching_of(state).itself[1])


def test_a_world_is_watched_alike_in_any_batch():
    world = small_world(sensing=Sight(radius=2), team=Team(n_agents=2, radio=Radio(carries="map")))
    seeds, episodes = torch.arange(4), torch.zeros(4, dtype=torch.int64)
    state, alone = world.reset(seeds, episodes), world.reset(seeds[2:3], episodes[2:3])
    for step in range(9):
        action = torch.full((4, 2), int(Action.SOUTH_EAST if step % 3 else Action.STAY))
        state, alone = world.step(state, action).after, world.step(alone, action[2:3]).after
    for name, leaf in watching_of(state).leaves().items():
        assert torch.equal(leaf[2:3], watching_of(alone).leaves()[name]), name
