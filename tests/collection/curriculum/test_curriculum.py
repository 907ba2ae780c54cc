"""What the rules have in common: levels, the target's share, and refused values."""

import pytest

from warp_torchrl.collection.curriculum import Curriculum, CurriculumState, Regret, Success

OVER = {"steps_per_tick": [20, 10, 5], "ignition": {"count": [1, 1, 2]}}


def test_levels_are_the_values_of_each_key_at_one_place():
    rule = Success(over=OVER)
    assert rule.values() == {"steps_per_tick": [20, 10, 5], "ignition.count": [1, 1, 2]}
    assert rule.n_levels == 3


@pytest.mark.parametrize(
    ("progress", "chances"), [(0.0, (0.75, 0.0, 0.25)), (0.49, (0.75, 0.0, 0.25)), (0.5, (0.0, 0.0, 1.0))]
)
def test_the_target_has_its_floor_and_from_until_on_everything(progress, chances):
    assert Success(over=OVER, floor=0.25, until=0.5).chances(CurriculumState.first(3), progress) == chances


def test_a_floor_at_the_target_adds_up():
    assert Success(over=OVER, floor=0.25).chances(CurriculumState.first(3).at(2), 0.0) == (0.0, 0.0, 1.0)


def test_a_rule_without_shares_is_told():
    with pytest.raises(TypeError, match="Curriculum does not say what it draws"):
        Curriculum(over=OVER).chances(CurriculumState.first(3), 0.0)


@pytest.mark.parametrize("rule", [Success, Regret])
@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"over": {"steps_per_tick": 5}}, "over.steps_per_tick must be a list of values, easy to hard, got 5"),
        ({"over": {"steps_per_tick": [5]}}, r"over.steps_per_tick must be a list of values, easy to hard, got \[5\]"),
        (
            {"over": {"steps_per_tick": [6, 5], "horizon": [9, 8, 7]}},
            "over must have as many values of each key, got steps_per_tick 2, horizon 3",
        ),
        (
            {"over": {"ignition.count": [1, 2]}},
            r"over must name ignition.count as {ignition: {count: \[...\]}}, or be given as over.ignition.count=",
        ),
        ({"over": [1, 2]}, r"over must be a mapping, got \[1, 2\]"),
        ({"floor": 1.5}, r"floor must be in \[0, 1\], got 1.5"),
        ({"until": -0.5}, r"until must be in \[0, 1\], got -0.5"),
        ({"episodes": 0}, r"episodes must be in \[1, 1e\+06\], got 0"),
        ({"measure": "burned"}, "measure must be saved or success, got 'burned'"),
    ],
)
def test_what_is_no_curriculum_is_refused_in_a_line(rule, values, line):
    with pytest.raises(ValueError, match=line):
        rule(**values)
