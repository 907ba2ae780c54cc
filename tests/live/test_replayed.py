"""A recording as a match."""

import pytest
import torch

from tests.live.conftest import SMALL
from warp_torchrl.live import words
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.replayed import ReplayedMatch
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.world.ignition.intervention import can_be_lit
from warp_torchrl.world.state.state import Action


@pytest.fixture(scope="module")
def played():
    """Ten steps in which a person drives, and the wind changes."""
    match = Match(Setting(policy="default", overrides=SMALL))
    side = match.sides[0]
    side.crew.take(0, person=1)
    for step in range(10):
        if step == 4:
            match.blow(9.0, 90.0)
        side.crew.press(0, 1, int(Action.SOUTH))
        match.step()
    return match


@pytest.fixture
def replayed(played):
    return ReplayedMatch(played.sides[0].record(), played.setting)


def test_it_plays_what_was_played_on_both_sides_and_stops_where_it_was_left(played, replayed):
    while not replayed.ended:
        replayed.step()
    for one, other in zip(replayed.everywhere, played.everywhere):
        leaves = other.state.leaves()
        assert all(torch.equal(value, leaves[name]) for name, value in one.state.leaves().items())
        assert one.curves.extinguished.equal(other.curves.extinguished)
    assert replayed.sides[0].curves.saved[-1] == played.sides[0].curves.saved[-1]
    assert replayed.sides[0].facing.equal(played.sides[0].facing)
    step = int(replayed.alone.state.step[0])
    assert replayed.step() == [] and int(replayed.alone.state.step[0]) == step == 10


def test_what_people_did_after_the_last_step_comes_at_the_end_on_both_sides(played):
    lit = next((row, column) for row in range(16) for column in range(16) if can_be_lit_now(played, row, column))
    before = played.alone.state.cells.clone()
    played.ignite(*lit)
    assert not played.alone.state.cells.equal(before)
    replayed = ReplayedMatch(played.sides[0].record(), played.setting)
    for _ in range(2):  # anew too
        replayed.restart()
        while not replayed.ended:
            replayed.step()
        for one, other in zip(replayed.everywhere, played.everywhere):
            assert one.state.cells.equal(other.state.cells)
            assert one.curves.burning == other.curves.burning


def can_be_lit_now(match, row, column):
    return all(bool(can_be_lit(side.state, match.world.fire)[0, row, column]) for side in match.everywhere)


def test_it_starts_anew_but_not_another_seed(replayed):
    for _ in range(7):
        replayed.step()
    replayed.restart()
    assert int(replayed.sides[0].state.step[0]) == 0
    while not replayed.ended:
        replayed.step()
    with pytest.raises(Refused, match="the recording is of seed 1000000"):
        replayed.restart(5)
    assert replayed.ended
    replayed.restart(1_000_000)
    assert not replayed.ended


def test_it_is_told_whose_it_is(replayed):
    assert words.headline(replayed) == "**default**, seed 1000000: step 0 of 30"
    assert words.title(replayed.sides[0]) == "recorded: default (4.0 M)"
    assert replayed.follow() == [] and replayed.questions() == []


def test_nobody_takes_part(replayed):
    side = replayed.sides[0]
    for act in (
        lambda: side.crew.take(0, 1),
        lambda: side.crew.press(0, 1, 0),
        lambda: side.crew.hand_back(0, 1),
        lambda: side.crew.ask_before(["clear"]),
        lambda: side.ask_where_unsure(0.5),
        lambda: side.order(0, None),
        lambda: replayed.blow(1.0, 0.0),
        lambda: replayed.ignite(3, 3),
        lambda: replayed.clear(3, 3),
        side.record,
    ):
        with pytest.raises(Refused, match=r"a recording is watched as it was played|a recording already"):
            act()


def test_what_is_another_episode_is_told_once_and_stands_still(replayed):
    replayed.recording.steps["agents", "action"][5, 2] = (replayed.recording.steps["agents", "action"][5, 2] + 4) % 8
    with pytest.raises(Unsound, match=r"step \d+ of the recording is not what this version plays"):
        for _ in range(10):
            replayed.step()
    assert replayed.ended and replayed.step() == []
