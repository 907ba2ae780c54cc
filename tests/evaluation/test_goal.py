"""What policies are compared by."""

from dataclasses import dataclass

import pytest

from tests.conftest import small_world
from warp_torchrl.evaluation.goal import goal
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
    assert goal(small_world(team=Team(n_agents=2, roles=roles), mechanics=mechanics)) == aim
