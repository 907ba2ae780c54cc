"""Reliability of beliefs, in numbers worked out by hand."""

import pytest
import torch

from tests.world.mechanics.there import is_there
from warp_torchrl.benchmark.beliefs import belief_table, counted, draw_reliability, reliability

pytestmark = pytest.mark.skipif(not is_there("radio", "sensing", "belief"), reason="worlds with beliefs")


def test_cells_are_counted_by_the_chance_that_they_were_believed_to_burn():
    chance = torch.tensor([[0.0, 0.5, 0.45], [0.5, 1.0, 1.0]])
    burns, counts = torch.tensor([[0, 1, 0], [1, 1, 0]]) > 0, torch.tensor([[1, 1, 1], [0, 1, 1]]) > 0
    (number, believed, burning), second = counted(chance, burns, counts)
    assert number.tolist() == [1, 0, 0, 0, 2, 0, 0, 0, 0] and second[0].tolist() == [0] * 8 + [2]
    assert believed.tolist() == pytest.approx([0, 0, 0, 0, 0.95, 0, 0, 0, 0]) and second[1, 8] == 2.0
    assert burning[4] == 1 and second[2, 8] == 1


def test_a_belief_is_measured_and_drawn(tmp_path):
    rows = reliability("scouts", "cpu", 2, ["landscape.size=16", "horizon=16", "belief.hidden=4"])
    assert rows and all(row["from"] <= row["believed"] + 1e-6 <= row["to"] + 2e-6 for row in rows)
    assert all(row["ci95"][0] <= row["burns"] <= row["ci95"][1] for row in rows)
    assert "mean chance" in belief_table(rows) and {row["scenario"] for row in rows} == {"scouts"}
    pytest.importorskip("matplotlib")
    draw_reliability(rows, tmp_path / "beliefs.png")
    assert (tmp_path / "beliefs.png").stat().st_size > 1000
