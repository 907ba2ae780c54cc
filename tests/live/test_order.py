"""An order is a mask: worked out by hand on a few cells."""

import pytest
import torch

from warp_torchrl.live.order import Order
from warp_torchrl.world.state.state import Action

N, NE, E, SE, S, SW, W, NW, EXTINGUISH, CLEAR, STAY = range(11)
OPEN = torch.ones(11, dtype=torch.bool)


def left(order, position, open_actions=OPEN, stride=1):
    mask = order.mask(open_actions, torch.tensor(position), stride)
    return {Action(code) for code in mask.nonzero()[:, 0].tolist()}


def test_on_the_way_only_moves_that_lead_nearer_are_open_and_extinguish():
    # From (0, 0) to (0, 5), 5 columns east: NE would end on row -1, 4 columns and 1 row away, which is 4 too.
    assert left(Order(row=0, column=5, radius=1), (0, 0)) == {NE, E, SE, EXTINGUISH}
    # To (5, 5) only SE: a move along one axis alone leaves the larger of the two distances at 5.
    assert left(Order(row=5, column=5, radius=0), (0, 0)) == {SE, EXTINGUISH}


def test_within_the_sector_moves_that_lead_out_of_it_are_closed_and_no_other_act():
    # At (2, 3) of a sector of 1 about (2, 2): any move east ends on column 4, 2 cells away.
    assert left(Order(row=2, column=2, radius=1), (2, 3)) == {N, S, SW, W, NW, EXTINGUISH, CLEAR, STAY}


def test_an_aircraft_s_longer_moves_are_counted():
    # Two cells a move, at (2, 2) of a sector of 1 about itself: every move ends 2 away.
    assert left(Order(row=2, column=2, radius=1), (2, 2), stride=2) == {EXTINGUISH, CLEAR, STAY}
    assert left(Order(row=2, column=9, radius=1), (2, 5), stride=2) == {NE, E, SE, EXTINGUISH}


def test_what_was_closed_stays_closed():
    only_west = torch.zeros(11, dtype=torch.bool)
    only_west[[W, NE]] = True
    assert left(Order(row=0, column=5, radius=1), (0, 0), only_west) == {NE}


def test_where_nothing_would_be_left_the_order_closes_nothing():
    shut_in = torch.zeros(11, dtype=torch.bool)
    shut_in[[W, STAY]] = True
    assert left(Order(row=0, column=5, radius=1), (0, 0), shut_in) == {W, STAY}


def test_the_nearest_move_prefers_the_straight_one():
    order = Order(row=0, column=5, radius=1)
    assert order.nearest_move(OPEN, torch.tensor([0, 0]), 1) == E
    assert order.nearest_move(torch.zeros(11, dtype=torch.bool), torch.tensor([0, 0]), 1) is None


@pytest.mark.parametrize("value", [{"row": -1}, {"radius": -1}, {"column": 1.5}])
def test_a_place_that_cannot_be_is_refused(value):
    with pytest.raises(ValueError, match=next(iter(value))):
        Order(**{"row": 0, "column": 0, **value})
