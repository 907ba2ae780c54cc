"""Scores of forecasts, in numbers worked out by hand."""

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores.cells import kappa
from warp_torchrl.prediction.scores.growth import forecast_scores, time_between
from warp_torchrl.prediction.scores.probabilities import joined_reliability, reliability
from warp_torchrl.world.fires.sightings import Front

ALL = drawn("######")


def front():
    """One cell had burned; then three more did, within an hour; two have not."""
    return Front(drawn("#....."), drawn("####.."), ALL, 60.0)


def test_cells_between_two_perimeters_burned_by_their_way():
    # Middles half a cell, 1.5 and 2.5 from the old edge, of a way of 3 cells
    assert time_between(front())[0].tolist() == pytest.approx([0.0, 10.0, 30.0, 50.0, 120.0, 120.0])


def test_persistence_has_a_brier_score_of_one():
    found = forecast_scores(drawn("#.....").float().expand(4, -1, -1), time_between(front()), front())
    assert found.brier == 1.0 and found.growth_jaccard == 0.0 and found.jaccard == pytest.approx(0.25)
    # 15, 30, 45, 60 minutes: 1, 2, 2 and 3 cells of three have burned; 60 * mean / 3
    assert found.crps == pytest.approx(60.0 * (1 + 2 + 2 + 3) / 4 / 3)


def test_a_forecast_is_scored_over_the_growth_alone():
    chance = torch.tensor([[1.0, 0.75, 0.5, 0.25, 0.5, 0.0]])
    found = forecast_scores(chance[None], time_between(front()), front())
    # 0.25^2 + 0.5^2 + 0.75^2 + 0.5^2 over three cells
    assert found.brier == pytest.approx((0.0625 + 0.25 + 0.5625 + 0.25) / 3.0)
    assert found.crps == pytest.approx(60.0 * found.brier)
    assert found.growth_jaccard == pytest.approx(2.0 / 4.0) and found.growth_sorensen == pytest.approx(4.0 / 6.0)
    assert found.jaccard == pytest.approx(3.0 / 5.0)
    assert found.area == pytest.approx(4.0 / 4.0)
    # told 4, burned 4, 3 of both, of 6: agreed 4/6; by chance (2/3)^2 + (1/3)^2 = 5/9
    assert found.kappa == pytest.approx((4.0 / 6.0 - 5.0 / 9.0) / (1.0 - 5.0 / 9.0))


def test_kappa_is_one_where_both_are_all():
    assert kappa(ALL, ALL) == 1.0 and kappa(ALL, drawn("###...")) == 0.0


def test_a_reliability_table_counts_each_bin():
    table = reliability(torch.tensor([0.05, 0.0, 0.0, 0.52, 0.58, 1.0]), drawn("#.#.##")[0])
    rows = {place: row for place, row in enumerate(table) if row[2]}
    assert rows.keys() == {0, 5, 9}
    assert rows[0] == pytest.approx((0.025, 1.0, 2)), "a cell of no chance that did not burn is left out"
    assert rows[5] == pytest.approx((0.55, 0.5, 2)) and rows[9] == pytest.approx((1.0, 1.0, 1))
    both = joined_reliability([table, table])
    assert both[5] == pytest.approx((0.55, 0.5, 4))
