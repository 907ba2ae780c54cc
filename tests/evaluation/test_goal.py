"""What policies are compared by."""

from dataclasses import dataclass

import pytest

from tests.conftest import small_world
from warp_torchrl.evaluation.goal import better_of, goal
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric
from warp_torchrl.world.team.team import Team


@dataclass(frozen=True)
class Watched(Mechanic):
    """Has the metric."""

    name = "watch"

    def metric_rows(self, world):
        return (Metric("watched"),)


@pytest.mark.parametrize(
    ("roles", "mechanics", "aim"),
    [
        (("scout",), (Watched(),), "watched"),
        (("scout",), (), "saved"),  # nothing is counted there
        (("scout", "ugv"), (Watched(),), "saved"),
        (("uav",), (Watched(),), "saved"),
    ],
)
def test_teams_that_cannot_act_are_compared_by_what_they_watch(roles, mechanics, aim):
    assert goal(small_world(team=Team(n_agents=2, roles=roles), mechanics=mechanics)).name == aim


def test_a_scenario_names_its_goal_among_its_metrics():
    assert goal(run_config(plain(compose_config("train", ["goal=burned"]))).world) == Metric("burned", "less")
    with pytest.raises(ConfigError, match=r"goal must be one of saved, .*, got burnt: did you mean burned\?"):
        run_config(plain(compose_config("train", ["goal=burnt"])))
    with pytest.raises(ValueError, match="goal must be one of saved"):
        goal(small_world(goal="extinguished"))  # neither more nor less of it is better


def test_what_is_better_reaches_more_or_less_of_the_goal():
    minutes, share = Metric("contained_at", "less", "min"), Metric("saved", "more")
    assert better_of({"sampled": [90.0], "deterministic": [60.0]}, [minutes]) == "deterministic"
    assert better_of({"sampled": [0.5], "deterministic": [0.4]}, [share]) == "sampled"
    # 60 of 90 minutes are a third less, and no more than 0.4 of the forest lost for it.
    assert better_of({"sampled": [90.0, 0.9], "deterministic": [60.0, 0.5]}, [minutes, share]) == "sampled"
    assert better_of({"sampled": [90.0, 0.9], "deterministic": [60.0, 0.6]}, [minutes, share]) == "deterministic"
    assert better_of({"sampled": [0.0], "deterministic": [0.0]}, [minutes]) == "sampled"
