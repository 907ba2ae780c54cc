"""The worlds of a mixture's kinds and of a curriculum's levels, and what is refused in a line."""

import pytest

from tests.world.mechanics.there import needs
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.world.air.wind import Wandering

TWO = "mixture.kinds={default:{share:3},water:{over:{team:{n_agents:2},wind:wandering},teacher:local}}"


def with_kinds(*overrides):
    return run_config(plain(compose_config("train", ["n_worlds=8", "processes=1", *overrides])))


def test_a_kind_is_its_scenario_with_what_differs():
    plan = with_kinds("mixture=several", TWO, "imitation.teacher=greedy", "scenario=single")
    plan.check_training()
    default, water = plan.kinds
    assert (default.name, default.world.team.n_agents, default.world.team.tank, default.teacher) == (
        "default", 4, None, "greedy",
    )  # fmt: skip
    assert (water.name, water.world.team.n_agents, water.world.team.tank, water.teacher) == ("water", 2, 8, "local")
    assert isinstance(water.world.wind, Wandering) and water.world.steps_per_tick == 1
    assert plan.worlds_of_kinds(8) == [6, 2]
    assert plan.world.team.n_agents == 1, "the run's own scenario is that which is evaluated at the end"


def test_a_kind_may_have_another_name_than_its_scenario():
    plan = with_kinds("mixture=several", "mixture.kinds={a:{scenario:default},b:{scenario:default,over:{horizon:9}}}")
    assert [(kind.name, kind.world.horizon) for kind in plan.kinds] == [("a", 256), ("b", 9)]


@needs("radio")
def test_a_kind_has_what_the_radio_of_the_run_carries():
    plan = with_kinds("mixture=several", TWO, "model.messages=graph")
    assert [kind.world.hearing.carries for kind in plan.kinds] == ["graph", "graph"]


def test_a_key_of_a_kind_that_its_file_leaves_out_can_be_given():
    plan = with_kinds("mixture=all", "mixture.kinds.windy.share=3", "mixture.kinds.windy.over.horizon=9", "n_worlds=64")
    windy = next(kind for kind in plan.kinds if kind.name == "windy")
    assert (windy.share, windy.world.horizon, windy.world.wind.speed) == (3.0, 9, 10.0)


def test_all_has_kinds_that_one_team_can_play():
    plan = with_kinds("mixture=all", "n_worlds=64", "imitation.teacher=coordinated")
    plan.check_training()
    assert {"water", "ring", "hazard", "sixteen"} <= {kind.name for kind in plan.kinds}
    assert {kind.world.team.n_agents for kind in plan.kinds} >= {1, 2, 4, 6, 8, 16}


def test_without_a_mixture_there_is_one_kind():
    (kind,) = with_kinds("scenario=default", "imitation.teacher=greedy").kinds
    assert (kind.name, kind.world.team.n_agents, kind.teacher) == ("default", 4, "greedy")


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        ([], "mixture.kinds must be two or more, got none: 'mixture.kinds={default:{},water:{share:2}}' names two"),
        (["mixture.kinds={default:{}}"], "mixture.kinds must be two or more, got default"),
        (["mixture.kinds={default:{},watr:{}}"], "mixture.kinds.watr: scenario must be one of .*did you mean water"),
        (["mixture=all", "mixture.kinds.watr.share=2"], "mixture.kinds.watr: scenario must be .*did you mean water"),
        (["mixture.kinds={default:{},water:{shares:2}}"], "mixture.kinds.water.shares is not a key.*did you mean"),
        (["mixture.kinds={default:{},water:{share:0}}"], "mixture.kinds.water.share must be in"),
        (
            ["mixture.kinds={default:{},water:{teacher:gredy}}"],
            "teacher must be null or one of .*mean greedy",
        ),
        (["mixture.kinds={default:{},water:{over:{reward:{act:0}}}}"], "water: over must name keys of the worlds"),
        (["mixture.kinds={default:{},water:{over:{scenario:ring}}}"], "water: over must name keys of the worlds"),
        (["mixture.kinds={default:{},water:{over:{team:{tank:-9}}}}"], "mixture.kinds.water: team.tank must be"),
        pytest.param(
            ["mixture.kinds={default:{},search:{}}"],
            "search: one team must see and do the same .* state",
            marks=needs("sensing"),
        ),
        (["mixture.kinds={default:{},paper_sarl:{}}"], "paper_sarl: one team must see and do the same .* differs"),
        ([TWO, "curriculum=success", "curriculum.over.steps_per_tick=[2,1]"], "mixture must be none with a curriculum"),
        ([TWO, "collector=process"], "mixture must be none where workers collect"),
        ([TWO, "algorithm=dqn"], "mixture must be none where the algorithm replays"),
        ([TWO, "model.sharing=none"], "mixture must be none where each agent has a network"),
        ([TWO, "compile=true"], "compile must be false with a mixture"),
        ([TWO, "n_worlds=1"], "n_worlds must be at least 2, one for each kind of the mixture, got 1"),
    ],
)
def test_a_mistake_is_one_line(overrides, line):
    with pytest.raises(ConfigError, match=line) as told:
        with_kinds("mixture=several", *overrides).check_training()
    assert "\n" not in str(told.value)


SMALL = ["scenario=spread_default", "landscape.size=12", "curriculum=success"]


def with_levels(*overrides):
    return run_config(plain(compose_config("train", [*SMALL, *overrides])))


def test_a_level_is_the_scenario_with_its_values_and_the_last_is_the_scenario():
    plan = with_levels(
        "curriculum.over={steps_per_tick:[20,10,5],ignition:{count:[1,1,2]}}", "curriculum.over.fire.tau=[2,3,5]"
    )
    plan.check_training()
    found = [(world.steps_per_tick, world.ignition.count, world.fire.tau) for world in plan.levels]
    assert found == [(20, 1, 2.0), (10, 1, 3.0), (5, 2, 5.0)]
    assert plan.levels[-1] == plan.world
    assert all(world.landscape is plan.world.landscape for world in plan.levels), "what is the same is the same one"


@needs("radio")
def test_a_level_may_have_another_value_of_a_mechanic():
    plan = with_levels("mechanics.radio={range:9.0,loss:0.1}", "curriculum.over.mechanics.radio.range=[3,9]")
    plan.check_training()
    assert [(world.hearing.range, world.hearing.loss) for world in plan.levels] == [(3.0, 0.1), (9.0, 0.1)]
    assert plan.levels[-1] == plan.world


def test_without_a_curriculum_there_is_one_level_and_the_plain_environment():
    plan = with_levels("curriculum=none")
    assert plan.levels == [plan.world] and type(plan.make_training_env(2, 0)).__name__ == "WildfireEnv"


def test_evaluations_are_of_the_scenario():
    plan = with_levels("curriculum.over.steps_per_tick=[9,5]")
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
        with_levels(*overrides).check_training()
    assert "\n" not in str(error.value)


def test_a_policy_that_had_a_curriculum_plays_other_scenarios():
    values = {"curriculum": {"over": {"steps_per_tick": [9, 1], "ignition": {"count": [1, 2]}}}}
    record = SavedConfig(choices={"curriculum": "success"}, values=values)
    assert run_config(plain(restore(record, ["scenario=spread_large"]))).make_env(1, 0).world.steps_per_tick == 6
    assert run_config(plain(restore(record))).levels[0].ignition.count == 1, "what a run resumes with"


def test_a_run_of_before_has_none():
    assert restore(SavedConfig(values={"seed": 3})).curriculum == {
        "_target_": "warp_torchrl.collection.curriculum.NoCurriculum"
    }
