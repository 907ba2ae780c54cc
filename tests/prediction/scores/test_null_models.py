"""The circle and the ellipse over fuel."""

import math

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores.null_models import (
    circle_cells,
    ellipse_cells,
    length_to_breadth,
    mean_wind,
    walking_ellipse_cells,
)

FUEL = torch.ones(61, 61, dtype=torch.bool)


def lit():
    cells = torch.zeros_like(FUEL)
    cells[30, 30] = True
    return cells


def test_both_have_the_cells_that_were_asked_for_and_burn_fuel_alone():
    fuel = FUEL.clone()
    fuel[:, 33:36] = False
    for burned in (circle_cells(lit(), fuel, 300), ellipse_cells(lit(), fuel, 300, torch.tensor([3.0, 0.0]))):
        assert int(burned.sum()) == 300 and not (burned & ~fuel).any() and burned[30, 30]


def test_a_circle_is_as_wide_as_high():
    burned = circle_cells(lit(), FUEL, 441)
    row, column = burned.nonzero().float().T
    assert row.mean() == pytest.approx(30, abs=0.2) and column.mean() == pytest.approx(30, abs=0.2)
    radius = math.sqrt(441 / math.pi)
    assert row.max() - 30 == pytest.approx(radius, abs=0.6) and column.max() - 30 == pytest.approx(radius, abs=0.6)


@pytest.mark.parametrize(("u", "v"), [(3.0, 0.0), (0.0, 3.0), (-3.0, 0.0), (0.0, -3.0)])
def test_an_ellipse_points_downwind_from_its_focus(u, v):
    burned = ellipse_cells(lit(), FUEL, 300, torch.tensor([u, v]))
    row, column = burned.nonzero().float().T
    east, north = column - 30, 30 - row
    along, across = (east * u + north * v) / 3.0, (east * v - north * u) / 3.0
    ratio = length_to_breadth(3.0)
    assert (along.max() - along.min()) / (across.max() - across.min()) == pytest.approx(ratio, rel=0.12)
    focus = math.sqrt(1 - ratio**-2)
    assert (along.max() + 0.5) / (0.5 - along.min()) == pytest.approx((1 + focus) / (1 - focus), rel=0.2)


def test_without_wind_the_ellipse_is_the_circle():
    assert torch.equal(ellipse_cells(lit(), FUEL, 300, torch.zeros(2)), circle_cells(lit(), FUEL, 300))


def test_the_length_to_breadth_is_that_of_the_canadian_curve():
    # 36 km/h: 1 + 8.729 (1 - exp(-1.08))^2.155 = 1 + 8.729 x 0.6604^2.155
    assert length_to_breadth(10.0) == pytest.approx(1 + 8.729 * 0.660404**2.155, rel=1e-4)
    assert length_to_breadth(0.0) == 1.0


def test_the_mean_wind_is_one_of_vectors_by_their_time():
    assert mean_wind(torch.tensor([[4.0, 0.0], [0.0, 2.0]]), torch.tensor([60.0, 180.0])).tolist() == [1.0, 1.5]


def test_a_walking_ellipse_goes_round_what_cannot_burn():
    fuel, still = drawn("#.###", "#.###", "#####", "#.###"), torch.zeros(2)
    start = drawn("#....", ".....", ".....", ".....")
    # Steps of 1, 2, 3 to the south; sqrt(5) to the gap, and over it 1 + sqrt(5)
    assert torch.equal(walking_ellipse_cells(start, fuel, 6, still), drawn("#....", "#....", "###..", "#...."))
    fuel[2, 1] = False
    assert int(walking_ellipse_cells(start, fuel, 99, still).sum()) == 4, "beyond the rock nothing is reached"


def test_a_walking_ellipse_over_open_fuel_is_nearly_the_plain_one():
    wind = torch.tensor([2.0, 1.0])
    walked, plain = walking_ellipse_cells(lit(), FUEL, 400, wind), ellipse_cells(lit(), FUEL, 400, wind)
    assert int((walked & plain).sum()) > 0.93 * 400


def test_a_knight_s_step_needs_one_of_the_cells_that_it_crosses():
    start, fuel = drawn("..#", "...", "..."), drawn("###", ".#.", ".#.")
    wind = torch.tensor([0.87, 0.0])  # e = 0.3
    # (2, 1) by a knight's step over (1, 1): sqrt(5) + e, 2.54; two steps to the west 2 + 2 e, 2.60
    assert torch.equal(walking_ellipse_cells(start, fuel, 4, wind), drawn(".##", ".#.", ".#."))
    assert int(walking_ellipse_cells(start, drawn("..#", "...", ".#."), 9, wind).sum()) == 1
