"""Scores of scars drawn by hand."""

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores.arrivals import arrival_error, burn_probability, first_cells, order_of_burning
from warp_torchrl.prediction.scores.cells import area_error, jaccard, sorensen
from warp_torchrl.prediction.scores.scar import scores_of
from warp_torchrl.world.law.travel import NEVER

SCAR = drawn("....", ".##.", ".##.")
TOLD = drawn("....", "###.", ".##.")  # 4 of both, 5 of either


def test_the_indices_of_two_drawn_scars():
    assert float(jaccard(TOLD, SCAR)) == pytest.approx(4 / 5)
    assert float(sorensen(TOLD, SCAR)) == pytest.approx(2 * 4 / (5 + 4))
    assert float(area_error(TOLD, SCAR)) == pytest.approx(1 / 4)


def test_the_indices_of_a_batch_are_those_of_its_maps_and_of_nothing_one():
    nothing = torch.zeros_like(SCAR)
    pair = torch.stack((TOLD, nothing))
    assert jaccard(pair, SCAR).tolist() == [pytest.approx(0.8), 0.0]
    assert jaccard(nothing, nothing) == 1.0 and sorensen(nothing, nothing) == 1.0


def test_cells_burn_in_the_order_of_the_median_fire_then_of_how_many_come():
    # Two fires, four cells: times 10 and 20 (median 10, the lower), 30 and 40, 50 and never, never
    times = torch.tensor([[[10.0, 40.0, 50.0, NEVER]], [[20.0, 30.0, NEVER, NEVER]]])
    assert burn_probability(times, 35.0).tolist() == [[1.0, 0.5, 0.0, 0.0]]
    order = order_of_burning(times, 60.0)
    assert order.tolist() == [[10.0, 30.0, 50.0, NEVER]]
    assert first_cells(order, 2).tolist() == [[True, True, False, False]]
    assert first_cells(order, 9).tolist() == [[True, True, True, False]], "what never burns is not chosen"


def test_cells_of_few_fires_come_after_those_of_half():
    times = torch.full((4, 1, 3), NEVER)
    times[:2, 0, 0], times[0, 0, 1] = 59.0, 1.0
    order = order_of_burning(times, 60.0)[0]
    assert order[0] == 59.0 and 60.0 < order[1] < 120.0 and order[2] == NEVER


def test_of_cells_of_few_fires_those_come_first_that_more_fires_reach():
    # Of eight fires by the hour 60: three come to the first cell, one to the second, two to the third.
    times = torch.full((8, 1, 4), NEVER)
    times[:3, 0, 0], times[:1, 0, 1], times[:2, 0, 2] = 50.0, 1.0, 20.0
    order = order_of_burning(times, 60.0)[0]
    assert order.tolist() == [60.0 * (2.0 - 3 / 8), 60.0 * (2.0 - 1 / 8), 60.0 * (2.0 - 2 / 8), NEVER]
    assert first_cells(order[None], 2).tolist() == [[True, False, True, False]]


def test_half_of_the_fires_are_enough_to_tell_a_cell_to_burn():
    times = torch.tensor([[[1.0, 1.0, NEVER]], [[1.0, NEVER, NEVER]]])
    assert scores_of(times, drawn("##."), 60.0).jaccard == 1.0


def test_times_of_arrival_are_compared_where_both_burned():
    times = torch.tensor([[[10.0, 30.0, 50.0, NEVER]]])
    observed = torch.tensor([[12.0, 24.0, float("nan"), 5.0]])  # off by -2 and 6
    found = arrival_error(times, observed, 60.0)
    assert found.bias == pytest.approx(2.0) and found.mean_absolute == pytest.approx(4.0)
    assert found.root_mean_square == pytest.approx((40 / 2) ** 0.5)
    assert arrival_error(times, torch.full_like(observed, float("nan")), 60.0) is None


def test_the_scores_of_a_fire_that_came_too_far():
    # Cells in their order: the scar is the first two, at the hour three burned.
    times = torch.tensor([[[1.0, 2.0, 3.0, NEVER]]])
    scar = drawn("##..")
    found = scores_of(times, scar, 3.0)
    assert found.jaccard_at_area == 1.0 and found.sorensen_at_area == 1.0
    assert found.jaccard == pytest.approx(2 / 3) and found.area_error == pytest.approx(0.5)
    assert found.arrival_bias is None
