"""Hidden fires, in numbers worked out by hand."""

import pytest
import torch

from tests.world.mechanics.belief.drawing import believing, members, seen
from tests.world.mechanics.belief.worlds import reset, rules
from tests.world.mechanics.drawing import begun as drawn_world
from warp_torchrl.world.arrays.random import imagined_keys
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import NAME, beliefs_of, cells_of, hidden_probability
from warp_torchrl.world.mechanics.belief.hidden import DOUBT, fires_lit, hidden_fires, struck

NONE = torch.zeros(1, 1, 1, 4, dtype=torch.bool)
FIRES = ("aTTT", "TaTT", "TaaT", "TTTT")


def test_a_fire_is_less_likely_by_the_doubt_for_each_cell_that_is_seen_to_be_otherwise():
    state = believing("TTTT", "TTTT", hidden=FIRES, possible=[1.0, 1.0, 1.0, 0.5])
    now = struck(state, beliefs_of(state), seen((1, "T"), (2, "T")), 0.3, NONE)
    assert now.possible.flatten().tolist() == pytest.approx([1.0, 0.3, 0.09, 0.5])
    assert now.found.flatten().tolist() == [0.0] * 4 and DOUBT == 0.3


def test_a_fire_that_has_burned_where_a_tree_is_seen_is_less_likely():
    state = believing("TTTT", "TTTT", hidden=[".aTT", "TaTT"])
    now = struck(state, beliefs_of(state), seen((0, "T")), 0.3, NONE)
    assert now.possible.flatten().tolist() == pytest.approx([0.3, 1.0])


def test_a_fire_that_burns_where_fire_is_seen_is_found():
    state = believing("TaTT", "TaTT", hidden=FIRES, possible=[1.0, 0.8, 0.6, 0.5])
    now = struck(state, beliefs_of(state), seen((1, "a"), (2, "T")), 0.3, NONE)
    assert now.possible.flatten().tolist() == pytest.approx([1.0, 0.0, 0.0, 0.5])
    assert now.found.flatten().tolist() == pytest.approx([0.0, 0.8, 0.6 * 0.3, 0.0])


def test_the_chance_that_a_hidden_fire_burns_somewhere():
    # Shares are 0.5 / 2, (0.3 + 0.2) / 2, 0.2 / 2 and 0; found ones count in the sum. Their mean is 0.15.
    held = beliefs_of(believing("TTTT", "TTTT", hidden=FIRES, possible=[0.5, 0.3, 0.2, 0.5]))
    held = held.replace(found=torch.tensor([[[0.5, 0.0, 0.0, 0.0]]]))
    assert hidden_probability(held, 2).flatten().tolist() == pytest.approx([1 - 0.85**2] * 4)
    one = held.replace(fires=torch.tensor([[1]], dtype=torch.int32))
    assert hidden_probability(one, 2).flatten().tolist() == pytest.approx([0.15] * 4), "one was found, and may be out"
    assert hidden_probability(one, 1).eq(0.0).all(), "all are known"
    assert hidden_probability(beliefs_of(believing("TT", "TT")), 2).eq(0.0).all(), "no hidden fires are kept"


def test_of_several_hidden_fires_the_first_to_arrive_counts_and_nothing_burns_twice():
    # Means over the cells: 1 / 4 burns and 1 / 4 has burned out.
    held = beliefs_of(believing("TTTT", "TTT.", "TTTT", hidden=("a.TT", "T.aT")))
    assert hidden_probability(held, 2).flatten().tolist() == pytest.approx([0.75**2 - 0.5**2] * 4)
    assert hidden_probability(held, 1).flatten().tolist() == pytest.approx([0.25] * 4)
    burned = held.replace(members=held.members.replace(burned=cells_of(held)[:, 0] == 0))
    assert hidden_probability(burned, 1).flatten().tolist() == pytest.approx([0.25] * 3 + [0.125])


def test_the_chance_of_a_hidden_fire_is_spread_over_cells_nearby():
    # One fire in the first of 12 cells: means over the 5, 6, 7, 8, 9 cells within 4 of a cell
    held = beliefs_of(believing("T" * 12, "T" * 12, hidden=["a" + "T" * 11]))
    expected = [1 / 5, 1 / 6, 1 / 7, 1 / 8, 1 / 9, *[0.0] * 7]
    assert hidden_probability(held, 1).flatten().tolist() == pytest.approx(expected)


def test_no_fire_is_hidden_where_none_can_burn_or_a_tree_was_just_seen():
    world = rules(belief=Ensemble(members=2, hidden=4), steps_per_tick=3)
    state = drawn_world(world, (0, 0), (0, 0), drawing="TTTT~TTTT")
    held = beliefs_of(state)
    state = state.with_planes(
        NAME, held.replace(hidden=held.hidden.replace(cells=torch.full_like(held.hidden.held["cells"], 11)))
    )
    chance = world.belief.hidden_chance(state, world)[0, 0, 0]
    assert (chance == 0.0).tolist() == [True, True, False, False, True, False, False, False, False]


def test_members_take_up_a_fire_that_nobody_knew_of_where_it_would_be():
    # Moved so that a cell that burns as what is seen lies there: the second fire's b on the third cell
    state = believing("TTbTTTTTTT", *["TTTTTTTTTT"] * 2, hidden=["TaTTTTTTTT", "TTTTTTTabT"])
    none = torch.zeros(1, 1, 1, 10, dtype=torch.bool)
    now = struck(state, beliefs_of(state), seen((2, "b"), (3, "T")), 0.3, none)
    assert sorted(members(state.with_planes(NAME, now))) == ["TTaTTTTTTT", "TabTTTTTTT"], "each another fire"
    assert now.fires.item() == 1 and now.lit[0, 0, 0].nonzero().flatten().tolist() == [2]
    recent = none.clone()
    recent[..., 1] = True
    held = struck(state, beliefs_of(state), seen((2, "b")), 0.3, recent)
    assert sorted(members(state.with_planes(NAME, held))) == ["TTaTTTTTTT", "TTbTTTTTTT"], "not where a tree was seen"


def test_fire_near_that_which_is_known_is_no_other_one():
    state = believing("TTbTTTTTTT", "TTTTTaTTTT", "TTTTTTTTTT", weights=[0.1, 0.9], hidden=["TTTTTTTabT"])
    now = struck(state, beliefs_of(state), seen((2, "b")), 0.3, torch.zeros(1, 1, 1, 10, dtype=torch.bool))
    assert now.fires.item() == 0 and members(state.with_planes(NAME, now)) == ["TTTTTaTTTT", "TTTTTTTTTT"]


def test_hidden_fires_are_drawn_from_the_ignition_one_by_one():
    world = rules(ignition=Ignition(count=3, radius=0, head_start=0, region=0.3))
    state = reset(world, 2)
    cells = hidden_fires(state, world, imagined_keys(state.key, state.step, 50)).held["cells"]
    assert fires_lit(world.lighting) == 3 and ((cells > 10).flatten(2).sum(2) == 1).all()
    where = (cells > 10).flatten(0, 1).any(dim=0).nonzero()
    assert where.min() >= 3 and where.max() <= 8 and len(where) > 5, "in the region, at many places"
