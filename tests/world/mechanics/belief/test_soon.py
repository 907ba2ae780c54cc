"""Where fire may burn soon: what members do while nobody looks."""

import pytest
import torch

from tests.world.mechanics.belief.worlds import LAWS, alight, begun, reset, rules, stay
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import beliefs_of, cells_of, mean_of
from warp_torchrl.world.mechanics.belief.soon import burns_within

UNKNOWN = {"rate_deviation": 0.4, "wind_speed_deviation": 0.3}


@pytest.mark.parametrize("law", LAWS)
def test_what_burns_soon_is_what_members_burn_while_nobody_looks(law):
    world = rules(law, size=32, steps_per_tick=1, belief=Ensemble(members=4, hidden=0, soon=9, **UNKNOWN))
    state = begun(world, reset(world, 2), drop=True)
    state = begun(world, alight(world, state, (5, 2), (6, 7)), (5, 1), (6, 6))
    away = torch.tensor([[31, 30], [31, 31]]).expand_as(state.vehicles.position).contiguous()
    state = world.step(state.replace(vehicles=state.vehicles.replace(position=away)), stay(state)).after
    soon, burned = beliefs_of(state).soon, cells_of(beliefs_of(state)) > 10
    for _ in range(9):
        state = world.step(state, stay(state)).after
        burned = burned | (cells_of(beliefs_of(state)) > 10)
    assert torch.equal(soon, mean_of(beliefs_of(state), burned))
    assert (soon > 0).sum() > (cells_of(beliefs_of(state))[:, 0, 0] > 10).sum() > 0, "and members differ"


def test_it_is_of_the_last_tick_and_in_worlds_that_tick_alone():
    world = rules(steps_per_tick=2, belief=Ensemble(members=3, hidden=0))
    state = begun(world, alight(world, reset(world, 2), (5, 2)), (5, 1), (5, 3))
    held = beliefs_of(state)
    state = state.with_planes("belief", held.replace(soon=torch.full_like(held.soon, 0.3)))
    mixed = state.replace(step=torch.tensor([0, 1], dtype=torch.int32))
    after = world.step(mixed, stay(mixed)).after
    now = beliefs_of(after).soon
    assert now[0].eq(now.new_tensor(0.3)).all()
    assert torch.equal(now[1:], burns_within(after[1:], world, world.fire, 2)) and now[1].amax() == 1.0
