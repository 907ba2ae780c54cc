"""How sightings weigh and correct members, in numbers worked out by hand."""

import pytest
import torch

from tests.world.mechanics.belief.drawing import believing, members, seen
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.mechanics.belief.beliefs import NAME, beliefs_of
from warp_torchrl.world.mechanics.belief.correcting import _chance, corrected, weighed

NONE = (0.0, 0.0)


def after(state, sightings, miss=0.0, false_alarm=0.0):
    """The worlds after sightings have corrected their members."""
    beliefs = corrected(state, beliefs_of(state), sightings, Fire(), miss, false_alarm)
    return state.with_planes(NAME, beliefs)


def weights(state, sightings, trust=1.0, doubt=0.02, errors=NONE):
    return weighed(state, beliefs_of(state), sightings, trust, doubt, errors)


def test_members_are_what_is_seen_where_it_is_seen():
    state = believing("TbTT", "aTTa", "TTT.")
    now = after(state, seen((0, "T"), (1, "b"), (2, ".")))
    assert members(now) == ["Tb.a", "Tb.."]
    assert beliefs_of(now).members.held["age"][0, :, 0].tolist() == [[0, 10, 0, 10], [0, 10, 0, 0]]


def test_firebreaks_ash_and_water_are_seen_too():
    state = believing("TTT", "TTT")
    state = state.replace(wet=torch.tensor([[[0, 3, 3]]], dtype=torch.uint8))
    yes, no = (torch.tensor([[[each, False]]]) for each in (True, False))
    held = beliefs_of(after(state, seen((0, "."), (1, "T"))._replace(ash=yes, cleared=no))).members.held
    assert held["burned"].tolist() == [[[[True, False, False]]]] and held["wet"].tolist() == [[[[0, 3, 0]]]]
    held = beliefs_of(after(state, seen((0, "."), (1, "T"))._replace(ash=no, cleared=yes))).members.held
    assert held["firebreak"].tolist() == [[[[True, False, False]]]]


def test_where_sight_errs_a_cell_burns_with_the_chance_of_bayes_rule():
    # p = 1/2: 0.45 / (0.45 + 0.005) of a fire that is seen, 0.05 / (0.05 + 0.495) of a tree
    state = believing("TTTT", "aaaa", "TTTT")
    no = torch.tensor([[[False, False, True, False]]])
    chance = _chance(beliefs_of(state), seen((0, "a"), (1, "T"), (2, "a"), (3, ".")), no, 0.1, 0.01)
    assert chance.flatten().tolist() == pytest.approx([0.45 / 0.455, 0.05 / 0.545, 0.0, 0.0]), "wet and empty: never"
    # All and none of them burn: p = 0.8 and 0.01
    for member, p in (("a", 0.8), ("T", 0.01)):
        state = believing("T", member, member)
        chance = _chance(beliefs_of(state), seen((0, "T")), torch.zeros(1, 1, 1, dtype=torch.bool), 0.1, 0.01)
        assert chance.item() == pytest.approx(p * 0.1 / (p * 0.1 + (1 - p) * 0.99))


def test_the_share_of_members_that_burn_is_that_chance():
    state = believing("TT", *["aa", "TT"] * 500)
    burn = members(after(state, seen((0, "T"), (1, "a")), 0.3, 0.1))
    shares = [sum(each[at] == "a" for each in burn) / 1000 for at in (0, 1)]
    # 0.15 / (0.15 + 0.45) = 1/4 and 0.35 / (0.35 + 0.05) = 7/8; 1000 draws: 4 standard deviations are 0.055 and 0.042
    assert shares[0] == pytest.approx(0.25, abs=0.055) and shares[1] == pytest.approx(0.875, abs=0.042)


def test_members_are_weighed_by_what_they_said():
    # One burns where fire is seen, the other does not: 0.9 : 0.1. In the next cell both say what is seen.
    state = believing("aTT", "aTT", "TTT", "TTT", weights=[0.2, 0.4, 0.4])
    held = weights(state, seen((0, "a"), (1, "T")), doubt=0.1)
    assert held.weights.flatten().tolist() == pytest.approx([0.18 / 0.26, 0.04 / 0.26, 0.04 / 0.26])
    # With trust 1/2 its root counts, 3 : 1; with miss 0.2 and false alarm 0.1, 0.9 is 0.9 0.8 + 0.1 0.1 = 0.73
    held = weights(state, seen((0, "a")), trust=0.5, doubt=0.1)
    assert held.weights[0, 0, 0].item() == pytest.approx(0.6 / (0.6 + 0.4 + 0.4))
    held = weights(state, seen((0, "a")), doubt=0.1, errors=(0.2, 0.1))  # and 0.1 is 0.1 0.8 + 0.9 0.1 = 0.17
    assert held.weights[0, 0, 0].item() == pytest.approx(0.2 * 0.73 / (0.2 * 0.73 + 0.8 * 0.17))
    held = weights(state, seen((0, "a"), first=False))
    assert held.weights.flatten().tolist() == pytest.approx([0.2, 0.4, 0.4]), "it was counted before"


def test_the_chance_to_have_ignited_counts_and_not_the_draw():
    # Both stand; the fire had 0.6 and 0.2 to reach the cell, and is seen there: 3 : 1
    held = weights(believing("a", "T", "T", chances=[0.6, 0.2]), seen((0, "a")))
    assert held.weights.flatten().tolist() == pytest.approx([0.75, 0.25])


def test_where_few_members_count_they_are_drawn_again():
    # 0.98 : 0.02 x 3 is an effective number of 1 / (0.942^2 + 3 0.019^2) = 1.13, under half of 4
    drawing = ("aT", "T1", "T2", "T3")
    state = believing("aT", *drawing, chances=[0.98, 0.01, 0.01, 0.01])
    now = weights(state, seen((0, "a")))
    drawn = members(state.with_planes(NAME, now))
    assert now.weights.flatten().tolist() == [0.25] * 4 and drawn.count("aT") >= 3
    assert now.members.held["key"].tolist() == [[0, 1, 2, 3]], "each burns on by draws of its own"
    values = now.chances.held["values"][0, :, 0, 0]
    assert [each == "aT" for each in drawn] == (values == 0.98).tolist(), "what a member was about to do goes with it"
    enough = weights(believing("aT", *drawing, chances=[0.4, 0.3, 0.2, 0.1]), seen((0, "a")))
    assert enough.weights.flatten().tolist() == pytest.approx([0.4, 0.3, 0.2, 0.1])
