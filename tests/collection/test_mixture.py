"""Mixtures: how many worlds each kind has."""

import pytest

from warp_torchrl.collection.mixture import Kind, Mixture, weights, worlds_by_share


@pytest.mark.parametrize(
    ("shares", "count", "given"),
    [
        ([1.0, 1.0], 8, [4, 4]),
        ([2.0, 1.0, 1.0], 8, [4, 2, 2]),
        ([1.0, 1.0, 1.0], 8, [3, 3, 2]),  # quotas of 2.67: two remainders are given, the first ones of equals
        ([5.0, 3.0, 1.0], 10, [6, 3, 1]),  # 5.56, 3.33, 1.11
        ([100.0, 1.0, 1.0], 6, [4, 1, 1]),  # none has nothing
        ([0.1, 0.1], 2, [1, 1]),
        ([3.3, 0.7], 8, [7, 1]),  # 6.6, 1.4: the largest remainder, not the largest quota for each world given
        ([7.0, 5.0, 0.1, 0.1, 0.1], 7, [3, 1, 1, 1, 1]),  # 3.98, 2.85: one each leaves 7, one of 3 and 2 must give
    ],
)
def test_worlds_are_apportioned_by_largest_remainders(shares, count, given):
    assert worlds_by_share(shares, count) == given


def test_fewer_worlds_than_kinds_are_refused():
    with pytest.raises(ValueError, match="n_worlds must be at least 3, one for each kind of the mixture, got 2"):
        worlds_by_share([1.0, 1.0, 1.0], 2)


def test_a_kind_has_a_share_and_a_teacher_a_weight():
    with pytest.raises(ValueError, match="share must be in"):
        Kind(scenario="water", share=0.0)
    with pytest.raises(ValueError, match="teacher_weight must be in"):
        Kind(scenario="water", teacher_weight=-1.0)
    assert Kind(scenario="water", share=1e6, teacher_weight=1e6).teacher_weight == 1e6
    with pytest.raises(ValueError, match="teacher_weight must be in"):
        Kind(scenario="water", teacher_weight=1e6 + 1)
    assert Mixture(worlds=100_000).worlds == 100_000
    with pytest.raises(ValueError, match="worlds must be in"):
        Mixture(worlds=100_001)


def test_what_is_left_to_learn_weighs_by_hand():
    """Left are 0.25 + 0.5, 0.25 + 1 where nothing is known yet, and the floor where the team is ahead."""
    found = weights([0.5, 0.25, 0.25], [0.4, None, 0.9], [0.8, 0.6, 0.7], 0.25)
    left = [0.5 * 0.75, 0.25 * 1.25, 0.25 * 0.25]
    assert found == pytest.approx([each / sum(left) for each in left])


def test_kinds_that_are_equally_far_keep_their_shares():
    assert weights([0.7, 0.3], [0.3, 0.4], [0.6, 0.8], 0.25) == pytest.approx([0.7, 0.3])
    assert weights([0.7, 0.3], [0.9, 0.9], [0.6, 0.8], 1e-6) == pytest.approx([0.7, 0.3])


def test_an_unknown_baseline_is_refused():
    with pytest.raises(ValueError, match=r"baseline must be one of .*, got gredy: did you mean greedy"):
        Mixture(baseline="gredy")


def test_kinds_and_what_was_saved_of_them_must_be_as_many():
    for shares, saved in (([1.0], [None]), ([0.5, 0.5], [None]), ([1.0], [None, 0.5])):
        with pytest.raises(ValueError, match=r"shorter|longer"):
            weights(shares, saved, [0.5, 0.6], 0.25)
