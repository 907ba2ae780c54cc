"""The concave hull of hot spots."""

import pytest
import torch

from tests.prediction.calibration.ground import drawn
from warp_torchrl.prediction.scores import hull
from warp_torchrl.prediction.scores.hull import hull_cells


def test_the_hull_fills_what_lies_between_hot_spots():
    pytest.importorskip("shapely", reason="needs the extra scores")
    hot = drawn("#...#", ".....", ".....", "#...#")
    assert torch.equal(hull_cells(hot, 1.0), torch.ones(4, 5, dtype=torch.bool))
    assert torch.equal(hull_cells(drawn("#....", ".....", "....."), 1.0), drawn("#....", ".....", "....."))


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "shapely", None)
    with pytest.raises(ValueError, match=r"hull needs shapely, which is missing: pip install .*scores"):
        hull.hull_cells(drawn("#"), 0.2)
