"""The paper's reward, worked out by hand."""

from functools import partial

import pytest

from tests.env.reward.drawing import CLEAR, EAST, EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl.env import reward
from warp_torchrl.world.state.cells import count_trees

Paper = partial(reward.Paper, shaping=0.0)


def test_the_paper_reward_by_hand():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    assert earned(Paper(team_share=0.0), state, world, EXTINGUISH, EAST) == pytest.approx([10 / 50, -0.2 / 50])
    assert earned(Paper(team_share=0.0), state, world, STAY, EXTINGUISH) == pytest.approx([0, -1 / 50])


def test_the_paper_reward_charges_clearing_far_from_fire():
    state, world = drawn(["FTTTTT", *["TTTTTT"] * 5], [[5, 5]])
    assert earned(Paper(), state, world, CLEAR) == pytest.approx([(1 - 2) / 50])


@pytest.mark.parametrize(("column", "earns"), [(3, 1.0), (4, 1.0 - 2.0)])
def test_clearing_is_near_up_to_three_cells_from_fire(column, earns):
    state, world = drawn(["FTTTTT", *["TTTTTT"] * 5], [[0, column]])
    assert earned(Paper(), state, world, CLEAR) == pytest.approx([earns / 50])


def test_the_barrier_pays_what_it_cuts_off_and_the_printed_one_pays_any_clearing():
    rows = ["TTT~TTT", "TFT~TTT", "TTTTTTT", "~~~~TTT"]
    # The only bridge is row 2, column 3: clearing it cuts the right hand side's 3 + 3 + 3 + 3 = 12 trees off. The
    # diagonal does not pass: (2, 2) and (3, 4) or (1, 4) are two columns apart.
    state, world = drawn(rows, [[2, 3]])
    initial = 9 + 1 + 12  # left block, bridge, right block; the fire is one of the left ones
    cut = earned(Paper(), state, world, CLEAR)[0]
    assert count_trees(state).initial.item() == initial
    assert cut == pytest.approx((1 + 50 * 12 / initial) / 50)
    elsewhere, _ = drawn(rows, [[0, 0]])
    assert earned(Paper(), elsewhere, world, CLEAR) == pytest.approx([1 / 50])
    assert earned(Paper(barrier_rule="printed"), elsewhere, world, CLEAR) == pytest.approx([51 / 50])


def test_the_printed_barrier_pays_who_clears_near_fire_and_no_other():
    # The fire is 2 columns from the first agent and 5 from the second, which clears; then the first clears too.
    state, world = drawn(["FTTTTT", *["TTTTTT"] * 5], [[2, 2], [5, 5]])
    printed = Paper(barrier_rule="printed", team_share=0.0)
    assert earned(printed, state, world, STAY, CLEAR) == pytest.approx([0.0, (1 - 2) / 50])
    assert earned(printed, state, world, CLEAR, CLEAR) == pytest.approx([(1 + 50) / 50, (1 - 2) / 50])
