"""The worlds of a curriculum's levels, and which are refused in a line."""

import pytest

from tests.world.mechanics.there import needs
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, plain
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.saved_config import SavedConfig, restore

SMALL = ["scenario=default", "landscape.size=12", "curriculum=success"]


def planned(*overrides):
    return run_config(plain(compose_config("train", [*SMALL, *overrides])))


def test_a_level_is_the_scenario_with_its_values_and_the_last_is_the_scenario():
    plan = planned(
        "curriculum.over={steps_per_tick:[20,10,5],ignition:{count:[1,1,2]}}", "curriculum.over.fire.tau=[2,3,5]"
    )
    plan.check_training()
    found = [(world.steps_per_tick, world.ignition.count, world.fire.tau) for world in plan.levels]
    assert found == [(20, 1, 2.0), (10, 1, 3.0), (5, 2, 5.0)]
    assert plan.levels[-1] == plan.world
    assert all(world.landscape is plan.world.landscape for world in plan.levels), "what is the same is the same one"


@needs("radio")
def test_a_level_may_have_another_value_of_a_mechanic():
    plan = planned("mechanics.radio={range:9.0,loss:0.1}", "curriculum.over.mechanics.radio.range=[3,9]")
    plan.check_training()
    assert [(world.hearing.range, world.hearing.loss) for world in plan.levels] == [(3.0, 0.1), (9.0, 0.1)]
    assert plan.levels[-1] == plan.world


def test_without_a_curriculum_there_is_one_level_and_the_plain_environment():
    plan = planned("curriculum=none")
    assert plan.levels == [plan.world] and type(plan.make_training_env(2, 0)).__name__ == "WildfireEnv"


def test_evaluations_are_of_the_scenario():
    plan = planned("curriculum.over.steps_per_tick=[9,5]")
    assert type(plan.make_env(2, 0)).__name__ == "WildfireEnv" and plan.make_env(2, 0).world == plan.world
    assert [world.steps_per_tick for world in plan.make_training_env(2, 0).levels] == [9, 5]


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        ([], r"curriculum.over must name a key of the scenario: curriculum.over.steps_per_tick=\[20,10,5\]"),
        (
            ["curriculum.over.steps_per_tik=[20,5]"],
            "curriculum.over.steps_per_tik is not a key of the scenario: did you mean steps_per_tick",
        ),
        (
            ["curriculum.over.algorithm.gamma=[0.9,0.99]"],
            "curriculum.over.algorithm.gamma is not a key of the scenario",
        ),
        (["curriculum.over.ignition=[1,2]"], "curriculum.over.ignition is not a key of the scenario"),
        (["curriculum.over.fire._target_=[a,b]"], "curriculum.over.fire._target_ is not a key of the scenario"),
        (
            ["curriculum.over.steps_per_tick=[20,10]"],
            "curriculum.over.steps_per_tick must end with the scenario's own value, 5, got 10",
        ),
        (
            ["curriculum.over.steps_per_tick=[-3,5]"],
            "curriculum.over, level 0: steps_per_tick must be in .*, got -3",
        ),
        (
            ["curriculum.over.team.extinguish_p=[2.0,1.0]"],
            r"curriculum.over, level 0: team.extinguish_p must be in \[0, 1\], got 2",
        ),
        (["curriculum.over.fire.tau=[slow,5.0]"], "curriculum.over, level 0: fire.tau must be a number, got 'slow'"),
        (
            ["curriculum.over.team.n_agents=[2,4]"],
            r"worlds of every level must have the shapes of the scenario's, and .* with team.n_agents=2 and",
        ),
        (
            ["curriculum.over.landscape.size=[10,12]"],
            r"state\S+ is \w+ \[10, 10\] with landscape.size=10 and \w+ \[12, 12\] without",
        ),
        (["curriculum.over.team.allow_stay=[false,true]"], r"with team.allow_stay=False"),
        (
            ["curriculum.over.cell_size=[60.0,30.0]", "cell_size=30.0"],
            "cell_size is 60.0 with cell_size=60.0 and 30.0 wi",
        ),
        (
            ["curriculum.over.steps_per_tick=[9,5]", "collector=process"],
            "curriculum must be none where workers collect",
        ),
        (["curriculum.over.steps_per_tick=[9,5]", "imitation.teacher=local"], "curriculum must be none with a teacher"),
        (["curriculum.over.steps_per_tick=[9,5]", "compile=true"], "compile must be false with a curriculum"),
        (["curriculum.over.steps_per_tick=[9,5]", "graph=true"], "graph must be false with a curriculum"),
        (["curriculum=regret", "curriculum.baseline=x"], "curriculum.baseline must be one of noop, "),
        (["curriculum.low=0.9"], "curriculum.low must be below high, 0.6, got 0.9"),
        (["curriculum=none", "curriculum.low=0.9"], "curriculum.low is not a key .* but with curriculum=success"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_is_refused_in_one_line(overrides, line):
    with pytest.raises(ConfigError, match=line) as error:
        planned(*overrides).check_training()
    assert "\n" not in str(error.value)


def test_a_policy_that_had_a_curriculum_plays_other_scenarios():
    values = {"curriculum": {"over": {"steps_per_tick": [9, 4], "ignition": {"count": [2, 1]}}}}
    record = SavedConfig(choices={"curriculum": "success"}, values=values)
    assert run_config(plain(restore(record, ["scenario=large"]))).make_env(1, 0).world.steps_per_tick == 6
    assert run_config(plain(restore(record))).levels[0].ignition.count == 2, "what a run resumes with"


def test_a_run_of_before_has_none():
    assert restore(SavedConfig(values={"seed": 3})).curriculum == {
        "_target_": "warp_torchrl.collection.curriculum.NoCurriculum"
    }
