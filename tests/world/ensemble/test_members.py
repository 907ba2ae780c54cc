"""Members of an ensemble, in other winds and at other rates of spread, in numbers worked out by hand."""

import math

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.arrays.random import imagined_keys
from warp_torchrl.world.ensemble.members import held, in_other_air, in_parameters, lit, unburned, worlds_of
from warp_torchrl.world.law.arrivals import Paces
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire

FOREST = "TTT TTT"


def test_a_wind_is_turned_to_the_left_and_scaled():
    # 3 m/s to the east, turned by 90 degrees and doubled, is 6 m/s to the north
    wind = torch.tensor([[3.0, 0.0], [0.0, 4.0], [3.0, 4.0]])[:, :, None, None]
    values = torch.tensor([[0.0, math.log(2.0), math.pi / 2], [0.0, 0.0, math.pi / 2], [1.0, math.log(0.5), 0.0]])
    turned = in_other_air(wind, values)[:, :, 0, 0]
    assert turned.flatten().tolist() == pytest.approx([0.0, 6.0, -4.0, 0.0, 1.5, 2.0], abs=1e-5)
    assert in_other_air(wind, None) is wind


@pytest.mark.parametrize(
    ("law", "expected"),
    [(Fire(), [0.4, 0.8, 1.0]), (HazardFire(), [0.4, 0.64, 0.784])],  # 1 - 0.6^2, 1 - 0.6^3
    ids=["paper", "hazard"],
)
def test_at_other_rates_flammability_is_another(law, expected):
    ground = draw(FOREST, fire=law, worlds=3).ground
    ground = ground.replace(alpha=torch.full_like(ground.alpha, 0.4))
    assert law.at_rate(ground, torch.tensor([1.0, 2.0, 3.0])).alpha[:, 0, 0].tolist() == pytest.approx(expected)


def test_at_twice_the_rate_times_are_half():
    law, ground = RateFire(), draw(FOREST, worlds=2).ground
    ground = ground.replace(terms=Paces(torch.full((2, 2, 3), 0.6)))
    assert law.at_rate(ground, torch.tensor([1.0, 2.0])).terms.pace[:, 0, 0].tolist() == pytest.approx([0.6, 0.3])


def test_worlds_in_parameters_have_the_wind_and_the_rate():
    law, state = Fire(), draw(FOREST, worlds=2, wind=(3.0, 0.0))
    state = state.replace(ground=state.ground.replace(alpha=torch.full_like(state.alpha, 0.4)))
    other = in_parameters(state, law, torch.tensor([[0.0, 0.0, 0.0], [math.log(2.0), math.log(2.0), math.pi]]))
    assert other.alpha[:, 0, 0].tolist() == pytest.approx([0.4, 0.8])
    assert other.wind.flatten().tolist() == pytest.approx([3.0, 0.0, -6.0, 0.0], abs=1e-5)
    assert in_parameters(state, law, None) is state


def test_members_share_the_ground_and_burn_on_their_own():
    law, state = Fire(), draw("aTT TT#", worlds=2)
    members = unburned(state, imagined_keys(state.key, state.step, 3), law)
    assert members.held["cells"].shape == (2, 3, 2, 3) and (members.held["cells"] <= 10).all()
    assert not members.held["firebreak"].any() and len(members.held["key"].unique()) == 6
    worlds = worlds_of(state, members, law)
    where = torch.zeros(6, 2, 3, dtype=torch.bool)
    where[4, 1, 1] = True  # of the second world the second member
    burning = held(lit(worlds, where, law), 3, law).held
    assert (burning["cells"] > 10).flatten(2).sum(2).tolist() == [[0, 0, 0], [0, 1, 0]]
    assert burning["age"][1, 1, 1, 1] == 10 and torch.equal(worlds.alpha[:3], state.alpha[:1].expand(3, -1, -1))


def test_members_draw_what_the_law_draws_of_the_ground():
    law = RateFire(cell_deviation=0.5)
    ground = draw(FOREST).ground.replace(terms=Paces(torch.ones(2, 2, 3)))
    paces = law.drawn_again(ground, torch.tensor([1, 2])).terms.pace
    assert (paces[0] != paces[1]).any() and law.draws == ("ground.terms.pace",) and Fire().draws == ()
    assert Fire().drawn_again(ground, torch.tensor([1, 2])) is ground
