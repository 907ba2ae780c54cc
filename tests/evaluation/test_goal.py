"""What policies are compared by."""

import pytest

from tests.conftest import small_world
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.world.mechanics.sensing.sensing import Full, Sight
from warp_torchrl.world.team.team import Team


@pytest.mark.parametrize(
    ("roles", "sensing", "aim"),
    [
        (("scout",), Sight(), "watched"),
        (("scout",), Full(), "saved"),  # nothing is counted there
        (("scout", "ugv"), Sight(), "saved"),
        (("uav",), Sight(), "saved"),
    ],
)
def test_teams_that_cannot_act_are_compared_by_what_they_watch(roles, sensing, aim):
    assert goal(small_world(team=Team(n_agents=2, roles=roles), sensing=sensing)) == aim
