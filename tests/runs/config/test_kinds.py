"""The kinds of a mixture: their worlds, their teachers, and what is refused in a line."""

import pytest

from tests.world.mechanics.there import needs
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, plain
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.air.wind import Wandering

TWO = "mixture.kinds={default:{share:3},water:{over:{team:{n_agents:2},wind:wandering},teacher:local}}"


def planned(*overrides):
    return run_config(plain(compose_config("train", ["n_worlds=8", "processes=1", *overrides])))


def test_a_kind_is_its_scenario_with_what_differs():
    plan = planned("mixture=several", TWO, "imitation.teacher=greedy", "scenario=single")
    plan.check_training()
    default, water = plan.kinds
    assert (default.name, default.world.team.n_agents, default.world.team.tank, default.teacher) == (
        "default", 4, None, "greedy",
    )  # fmt: skip
    assert (water.name, water.world.team.n_agents, water.world.team.tank, water.teacher) == ("water", 2, 8, "local")
    assert isinstance(water.world.wind, Wandering) and water.world.steps_per_tick == 6
    assert plan.worlds_of_kinds(8) == [6, 2]
    assert plan.world.team.n_agents == 1, "the run's own scenario is that which is evaluated at the end"


def test_a_kind_may_have_another_name_than_its_scenario():
    plan = planned("mixture=several", "mixture.kinds={a:{scenario:default},b:{scenario:default,over:{horizon:9}}}")
    assert [(kind.name, kind.world.horizon) for kind in plan.kinds] == [("a", 256), ("b", 9)]


@needs("radio")
def test_a_kind_has_what_the_radio_of_the_run_carries():
    plan = planned("mixture=several", TWO, "model.messages=graph")
    assert [kind.world.hearing.carries for kind in plan.kinds] == ["graph", "graph"]


def test_a_key_of_a_kind_that_its_file_leaves_out_can_be_given():
    plan = planned("mixture=all", "mixture.kinds.windy.share=3", "mixture.kinds.windy.over.horizon=9", "n_worlds=64")
    windy = next(kind for kind in plan.kinds if kind.name == "windy")
    assert (windy.share, windy.world.horizon, windy.world.wind.speed) == (3.0, 9, 10.0)


def test_all_has_kinds_that_one_team_can_play():
    plan = planned("mixture=all", "n_worlds=64", "imitation.teacher=coordinated")
    plan.check_training()
    assert {"water", "ring", "hazard", "sixteen"} <= {kind.name for kind in plan.kinds}
    assert {kind.world.team.n_agents for kind in plan.kinds} >= {1, 2, 4, 6, 8, 16}


def test_without_a_mixture_there_is_one_kind():
    (kind,) = planned("scenario=default", "imitation.teacher=greedy").kinds
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
            "search: one team must see and do the same .* observation picture",
            marks=needs("sensing"),
        ),
        (["mixture.kinds={default:{},paper_sarl:{}}"], "paper_sarl: one team must see and do the same .* differs"),
        ([TWO, "curriculum=success", "curriculum.over.steps_per_tick=[5,4]"], "mixture must be none with a curriculum"),
        ([TWO, "collector=process"], "mixture must be none where workers collect"),
        ([TWO, "algorithm=dqn"], "mixture must be none where the algorithm replays"),
        ([TWO, "model.sharing=none"], "mixture must be none where each agent has a network"),
        ([TWO, "compile=true"], "compile must be false with a mixture"),
        ([TWO, "n_worlds=1"], "n_worlds must be at least 2, one for each kind of the mixture, got 1"),
    ],
)
def test_a_mistake_is_one_line(overrides, line):
    with pytest.raises(ConfigError, match=line) as told:
        planned("mixture=several", *overrides).check_training()
    assert "\n" not in str(told.value)
