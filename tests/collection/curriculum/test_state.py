"""Groups of episodes by which levels are judged."""

import torch

from warp_torchrl.collection.curriculum import CurriculumState
from warp_torchrl.collection.curriculum.state import episodes_by_level


def test_a_level_is_judged_by_each_full_group_and_counts_anew():
    state = CurriculumState.first(2).after([3, 1], [1.5, 1.0], group=4)
    assert (state.counts, state.judged) == ((3, 1), (None, None))
    state = state.after([2, 0], [1.0, 0.0], group=4)
    assert state.judged == (0.5, None)  # (1.5 + 1.0) / 5
    assert (state.counts, state.sums) == ((0.0, 1), (0.0, 1.0))
    state = state.after([1, 3], [0.9, 3.0], group=4)
    assert state.judged == (0.5, 1.0)  # (1.0 + 3.0) / 4; the other level's group is open


def test_a_level_that_is_entered_is_judged_by_what_follows():
    state = CurriculumState.first(2).after([4, 6], [2.0, 6.0], group=4)
    state = state.after([1, 1], [0.0, 0.0], group=4)
    entered = state.at(1)
    assert (entered.level, entered.judged, entered.counts, entered.sums) == (1, (0.5, None), (1.0, 0.0), (0.0, 0.0))


def test_a_standing_comes_back_from_its_state():
    state = CurriculumState.first(3, baseline=(0.9, 0.5, 0.25)).after([4, 1, 0], [2.0, 0.5, 0.0], group=4)
    assert CurriculumState.of(state.at(2).state_dict()) == state.at(2)


def test_episodes_that_ended_are_counted_at_their_levels():
    level = torch.tensor([[0, 0, 2], [2, 2, 2]])[..., None]
    done = torch.tensor([[False, True, False], [True, False, True]])[..., None]
    measure = torch.tensor([[9.0, 0.5, 9.0], [0.25, 9.0, 0.5]])[..., None]
    assert episodes_by_level(level, done, measure, 3).tolist() == [[1.0, 0.0, 2.0], [0.5, 0.0, 0.75]]
