"""Shares in proportion to what a baseline saves and the team does not."""

import pytest

from warp_torchrl.collection.curriculum import CurriculumState, Regret

OVER = {"steps_per_tick": [20, 10, 5]}


def judged(*successes, baseline=(0.9, 0.6, 0.2)):
    counts = [0.0 if each is None else 10.0 for each in successes]
    state = CurriculumState.first(3, baseline)
    return Regret(over=OVER, episodes=10).after(state, counts, [10.0 * (each or 0.0) for each in successes])


@pytest.mark.parametrize(
    ("successes", "shares"),
    [
        ((0.6, 0.1, 0.0), (0.3, 0.5, 0.2)),  # regrets 0.3, 0.5, 0.2
        ((0.95, 0.6, 0.1), (0.0, 0.0, 1.0)),  # better than the baseline is no regret: 0, 0, 0.1
        ((None, 0.6, 0.1), (0.9, 0.0, 0.1)),  # 0.9, 0, 0.1: what is not known yet counts as nothing saved
        ((1.0, 1.0, 1.0), (0.0, 0.0, 1.0)),  # no regret at all
    ],
)
def test_shares_are_the_regrets(successes, shares):
    state = judged(*successes)
    assert Regret(over=OVER).shares(state) == pytest.approx(shares)
    with_floor = Regret(over=OVER, floor=0.5).chances(state, 0.0)
    assert with_floor == pytest.approx([0.5 * each + 0.5 * (at == 2) for at, each in enumerate(shares)])


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"baseline": "greedi"}, "baseline must be one of noop, .*, got greedi: did you mean greedy"),
        ({"worlds": 0}, r"worlds must be in \[1, 4096\], got 0"),
    ],
)
def test_what_is_no_baseline_is_refused(values, line):
    with pytest.raises(ValueError, match=line):
        Regret(over=OVER, **values)
