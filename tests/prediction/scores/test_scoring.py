"""A predicted fire beside what was seen, drawn by hand."""

import math

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores.predicted import Predicted
from warp_torchrl.prediction.scores.report import score_lines, score_numbers
from warp_torchrl.prediction.scores.scoring import Place, fire_scores, times_seen
from warp_torchrl.prediction.scores.seen import Seen
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.terrain.grid import Grid

GRID = Grid((1, 6), None, (100.0, 0.0, 0.0, 0.0, -100.0, 100.0))  # cells of a hectare
START = Place(lit=drawn("#....."))


@pytest.fixture(autouse=True)
def placed(monkeypatch):
    monkeypatch.setattr(Grid, "cell_size", 100.0)


def seen(*rows):
    return [Seen(minutes=60.0 * (at + 1), kind="perimeter", burned=drawn(row)) for at, row in enumerate(rows)]


def fires(*rows):
    """Hours of arrival of each fire, a digit a cell; a point for never."""
    times = [[NEVER if each == "." else 60.0 * float(each) for each in row] for row in rows]
    return Predicted(grid=GRID, arrival=torch.tensor(times)[:, None])


def test_each_observation_is_scored_on_its_growth_and_beside_persistence():
    found = fire_scores(fires("0113.."), seen("##....", "####.."), place=START)
    first, second = found.observations
    assert (first.seen_ha, first.predicted_ha) == (2.0, 3.0)
    assert first.forecast.jaccard == pytest.approx(2 / 3) and first.persistence["jaccard"] == pytest.approx(1 / 2)
    assert first.forecast.growth_jaccard == pytest.approx(1 / 2), "one of two cells that it grew by"
    assert second.forecast.jaccard == pytest.approx(3 / 4)
    # of the third and fourth cell that burned in the second hour the prediction has the third
    assert second.forecast.growth_sorensen == pytest.approx(2 * 1 / (1 + 2)) and second.persistence["kappa"] < 1.0
    assert second.areas is None, "one fire has no interval"


def test_times_between_two_perimeters_are_those_of_a_cell_s_way():
    times = times_seen(seen("##....", "####.."))
    assert times.isnan().tolist() == [[True, True, False, False, True, True]]
    assert times[0, 2:4].tolist() == pytest.approx([75.0, 105.0])
    found = fire_scores(fires("0112.."), seen("##....", "####.."))
    assert found.arrival.bias == pytest.approx((60.0 - 75.0 + 120.0 - 105.0) / 2)
    assert found.arrival.mean_absolute == pytest.approx(15.0)
    assert times_seen(seen("##....")) is None


def test_an_ensemble_has_an_interval_of_areas_and_a_probability():
    two = fires("01....", "0111..")
    (only,) = fire_scores(two, seen("###..."), place=START).observations
    assert only.areas.median == 2.0 and only.areas.low == pytest.approx(2.1) and only.areas.high == pytest.approx(3.9)
    assert only.areas.holds and only.forecast.brier == pytest.approx((0.0 + 0.25 + 0.25) / 2)
    whole = fire_scores(two, seen("#.....", "###..."), place=START)
    assert whole.brier == pytest.approx((0.25 + 0.25) / 3), "three cells burned; two of the second, of which half"
    assert [row[2] for row in whole.reliability if row[2]] == [2, 2]
    wrong = fire_scores(two, seen("######"), place=START).observations[0]
    assert not wrong.areas.holds


def test_a_map_of_probability_alone_has_scores_without_times():
    chance = Predicted(grid=GRID, probability=torch.tensor([[1.0, 0.5, 0.5, 0.0, 0.0, 0.0]]))
    found = fire_scores(chance, seen("##...."), place=START)
    numbers = score_numbers(found, "drawn")
    only = numbers["observations"][0]
    assert only["forecast"]["crps"] is None and only["forecast"]["brier"] == pytest.approx(0.5)
    assert numbers["at_area"] == {} and numbers["arrival"] is None
    assert math.isfinite(only["forecast"]["kappa"])


def test_null_models_grow_over_fuel_to_the_area_that_was_seen():
    place = Place(lit=drawn("#....."), fuel=drawn("##.###"), wind=torch.tensor([5.0, 0.0]))
    found = fire_scores(fires("01...."), seen("##.##."), place=place)
    assert set(found.at_area) == {"predicted", "circle", "ellipse", "walking ellipse"}
    assert found.at_area["ellipse"].jaccard_at_area == 1.0, "it goes through the rock"
    assert found.at_area["walking ellipse"].jaccard_at_area == pytest.approx(2 / 4), "it does not"
    lines = score_lines(score_numbers(found, "drawn"))
    assert "| walking ellipse | 0.500 | 0.667 |" in lines and "# Scores: drawn" in lines
