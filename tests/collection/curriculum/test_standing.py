"""Groups of episodes by which levels are judged."""

import torch

from warp_torchrl.collection.curriculum import Standing
from warp_torchrl.collection.curriculum.standing import episodes_by_level


def test_a_level_is_judged_by_each_full_group_and_counts_anew():
    standing = Standing.first(2).after([3, 1], [1.5, 1.0], group=4)
    assert (standing.counts, standing.judged) == ((3, 1), (None, None))
    standing = standing.after([2, 0], [1.0, 0.0], group=4)
    assert standing.judged == (0.5, None)  # (1.5 + 1.0) / 5
    assert (standing.counts, standing.sums) == ((0.0, 1), (0.0, 1.0))
    standing = standing.after([1, 3], [0.9, 3.0], group=4)
    assert standing.judged == (0.5, 1.0)  # (1.0 + 3.0) / 4; the other level's group is open


def test_a_level_that_is_entered_is_judged_by_what_follows():
    standing = Standing.first(2).after([4, 6], [2.0, 6.0], group=4)
    standing = standing.after([1, 1], [0.0, 0.0], group=4)
    entered = standing.at(1)
    assert (entered.level, entered.judged, entered.counts, entered.sums) == (1, (0.5, None), (1.0, 0.0), (0.0, 0.0))


def test_a_standing_comes_back_from_its_state():
    standing = Standing.first(3, baseline=(0.9, 0.5, 0.25)).after([4, 1, 0], [2.0, 0.5, 0.0], group=4)
    assert Standing.of(standing.at(2).state_dict()) == standing.at(2)


def test_episodes_that_ended_are_counted_at_their_levels():
    level = torch.tensor([[0, 0, 2], [2, 2, 2]])[..., None]
    done = torch.tensor([[False, True, False], [True, False, True]])[..., None]
    measure = torch.tensor([[9.0, 0.5, 9.0], [0.25, 9.0, 0.5]])[..., None]
    assert episodes_by_level(level, done, measure, 3).tolist() == [[1.0, 0.0, 2.0], [0.5, 0.0, 0.75]]
