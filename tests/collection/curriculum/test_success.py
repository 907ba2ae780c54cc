"""The ladder: up above ``high``, down below ``low``, level by level."""

import pytest

from warp_torchrl.collection.curriculum import CurriculumState, Success

OVER = {"steps_per_tick": [20, 10, 5]}


def rule(**values):
    return Success(over=OVER, episodes=10, low=0.25, high=0.75, floor=0.0, **values)


@pytest.mark.parametrize(
    ("level", "success", "then"),
    [
        *((0, 0.8, 1), (1, 0.8, 2), (2, 0.8, 2)),  # mastered: on to the next, the target is the last
        *((0, 0.2, 0), (1, 0.2, 0), (2, 0.2, 1)),  # too hard: back, the easiest is the first
        *((0, 0.5, 0), (1, 0.5, 1), (1, 0.75, 1), (1, 0.25, 1)),  # between the bounds, which belong to it
    ],
)
def test_success_above_the_bounds_leads_on_and_below_them_back(level, success, then):
    counts = [10.0 * (each == level) for each in range(3)]
    after = rule().after(CurriculumState.first(3).at(level), counts, [count * success for count in counts])
    assert after.level == then
    assert rule().chances(after, 0.0) == tuple(float(each == then) for each in range(3))


def test_a_level_is_left_on_a_full_group_of_its_own_episodes_alone():
    state = CurriculumState.first(3)
    state = rule().after(state, [9.0, 50.0, 50.0], [9.0, 0.0, 0.0])
    assert state.level == 0
    state = rule().after(state, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    assert state.level == 1 and state.judged == (1.0, None, 0.0)  # of level 1 what was before does not count
    state = rule().after(state, [10.0, 0.0, 10.0], [10.0, 0.0, 10.0])
    assert state.level == 1  # others were judged, this one was not


def test_a_judgement_moves_once():
    state = rule().after(CurriculumState.first(3), [10.0, 0.0, 0.0], [10.0, 0.0, 0.0])
    state = rule().after(state, [0.0, 10.0, 0.0], [0.0, 5.0, 0.0])
    state = rule().after(state, [0.0, 0.0, 3.0], [0.0, 0.0, 3.0])
    assert state.level == 1


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"low": 0.6, "high": 0.6}, "low must be below high, 0.6, got 0.6"),
        ({"high": 1.2}, r"high must be in \[0, 1\], got 1.2"),
        ({"low": 1.2}, r"low must be in \[0, 1\], got 1.2"),
    ],
)
def test_bounds_that_bound_nothing_are_refused(values, line):
    with pytest.raises(ValueError, match=line):
        Success(over=OVER, **values)
