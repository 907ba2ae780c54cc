"""Hidden fires, in numbers worked out by hand."""

import pytest
import torch

from tests.world.mechanics.belief.drawing import believing, members, seen
from tests.world.mechanics.belief.worlds import reset, rules
from warp_torchrl.world.arrays.random import imagined_keys
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.mechanics.belief.beliefs import NAME, beliefs_of, hidden_probability
from warp_torchrl.world.mechanics.belief.hidden import DOUBT, fires_lit, hidden_fires, struck

FIRES = ("aTTT", "TaTT", "TaaT", "TTTT")


def test_a_fire_is_less_likely_by_the_doubt_for_each_cell_that_is_seen_to_be_otherwise():
    state = believing("TTTT", "TTTT", hidden=FIRES, possible=[1.0, 1.0, 1.0, 0.5])
    now = struck(state, beliefs_of(state), seen((1, "T"), (2, "T")), 0.3)
    assert now.possible.flatten().tolist() == pytest.approx([1.0, 0.3, 0.09, 0.5])
    assert now.found.flatten().tolist() == [0.0] * 4 and DOUBT == 0.3


def test_a_fire_that_has_burned_where_a_tree_is_seen_is_less_likely():
    state = believing("TTTT", "TTTT", hidden=[".aTT", "TaTT"])
    now = struck(state, beliefs_of(state), seen((0, "T")), 0.3)
    assert now.possible.flatten().tolist() == pytest.approx([0.3, 1.0])


def test_a_fire_that_burns_where_fire_is_seen_is_found():
    state = believing("TaTT", "TaTT", hidden=FIRES, possible=[1.0, 0.8, 0.6, 0.5])
    now = struck(state, beliefs_of(state), seen((1, "a"), (2, "T")), 0.3)
    assert now.possible.flatten().tolist() == pytest.approx([1.0, 0.0, 0.0, 0.5])
    assert now.found.flatten().tolist() == pytest.approx([0.0, 0.8, 0.6 * 0.3, 0.0])


def test_the_chance_that_a_hidden_fire_burns_somewhere():
    # Of 2 fires none is known. Shares are 0.5 / 2, (0.3 + 0.2) / 2 and 0.2 / 2; found ones count in the sum.
    state = believing("TTTT", "TTTT", hidden=FIRES, possible=[0.5, 0.3, 0.2, 0.5])
    held = beliefs_of(state)
    held = held.replace(found=torch.tensor([[[0.5, 0.0, 0.0, 0.0]]]))
    none_known = [1 - 0.75**2, 1 - 0.75**2, 1 - 0.9**2, 0.0]
    assert hidden_probability(held).flatten().tolist() == pytest.approx(none_known)
    burning = beliefs_of(believing("aTTT", "TTTT", "aTTT", hidden=FIRES, possible=[0.5, 0.3, 0.2, 0.5]))
    burning = burning.replace(found=held.found)
    assert hidden_probability(burning).flatten().tolist() == pytest.approx([0.25, 0.25, 0.1, 0.0])
    one = burning.replace(lit=torch.ones_like(burning.lit))
    assert hidden_probability(one).eq(0.0).all(), "all are known"
    assert hidden_probability(beliefs_of(believing("TT", "TT"))).eq(0.0).all(), "no hidden fires are kept"


def test_members_take_up_a_fire_that_nobody_knew_of():
    state = believing("TaTT", "TTTT", "TTTT", hidden=["TabT", "aTTT"])
    now = struck(state, beliefs_of(state), seen((1, "a")), 0.3)
    assert members(state.with_planes(NAME, now)) == ["TabT", "TabT"], "and where it is not seen"
    known = believing("TaTT", "TaTT", "TTTT", hidden=["TabT", "aTTT"])
    held = struck(known, beliefs_of(known), seen((1, "a")), 0.3)
    assert members(known.with_planes(NAME, held)) == ["TaTT", "TTTT"]
    other = struck(state, beliefs_of(state), seen((3, "a")), 0.3)
    assert members(state.with_planes(NAME, other)) == ["TTTT", "TTTT"], "no hidden fire burns there"


def test_hidden_fires_are_drawn_from_the_ignition_one_by_one():
    world = rules(ignition=Ignition(count=3, radius=0, head_start=0, region=0.3))
    state = reset(world, 2)
    cells = hidden_fires(state, world, imagined_keys(state.key, state.step, 50)).held["cells"]
    assert fires_lit(world.lighting) == 3 and ((cells > 10).flatten(2).sum(2) == 1).all()
    where = (cells > 10).flatten(0, 1).any(dim=0).nonzero()
    assert where.min() >= 3 and where.max() <= 8 and len(where) > 5, "in the region, at many places"
