"""Pictures of beliefs: what nobody saw changes nothing in them."""

import pytest
import torch

from tests.world.mechanics.belief.worlds import alight, begun, reset, rules, stay
from warp_torchrl.env.pictures.veil import first_view, seen_as
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.team.knowledge import Belief

AT = (5, 0), (5, 1)
BELIEFS = {
    "ensemble": (Ensemble(members=4, hidden=8), True),
    "of each agent": (Ensemble(of="agent", members=2, hidden=4), False),
    "records": (Belief(), True),
    "records of each agent": (Belief(), False),
}


@pytest.mark.parametrize("name", BELIEFS)
def test_a_fire_that_nobody_saw_is_in_no_picture_of_a_belief(name):
    belief, shares = BELIEFS[name]
    world = rules(belief=belief, shares=shares)
    state = begun(world, alight(world, begun(world, reset(world), *AT, drop=True), (11, 11), (5, 2)), *AT)
    other = begun(world, alight(world, state, *[(row, 5) for row in range(4)]), *AT)
    for _ in range(3):
        fires, beliefs = ([seen_as(each, world, view)[1] for each in (state, other)] for view in ("truth", "belief"))
        assert torch.equal(*beliefs) and not torch.equal(*fires)
        state, other = (world.step(each, stay(each)).after for each in (state, other))


def test_a_team_with_beliefs_is_shown_with_them_at_first():
    assert first_view(rules()) == "both" and first_view(rules(belief=Belief())) == "truth"
