"""The table of fires beside those of pyretechnics, without that package."""

import sys

import numpy as np
import pytest

from warp_torchrl.benchmark import witness
from warp_torchrl.benchmark.witness import of_crowns, witness_errors, witness_table


def test_beds_that_agree_are_counted_and_the_largest_difference_is_named(monkeypatch):
    def alike(bed):
        columns = {name: np.array([value]) for name, value in bed.items()}
        layers = ("cover", "height") if bed["canopy_base_height"] > 150.0 else of_crowns.__defaults__[0]
        found = of_crowns(columns, layers)
        off = 1.02 if bed["slope"] > 30.0 else 1.0
        kind = 0.0 if found.kind is None else float(found.kind)
        return kind, float(found.head) * off, float(found.intensity), float(found.flame_length)

    monkeypatch.setattr(witness, "crown_witness", alike)
    steep = sum(bed["slope"] > 30.0 for bed in witness.crown_beds(20))
    rows = {row["quantity"]: row for row in witness_errors(20)}
    assert rows["kind of fire"]["agree %"] == rows["intensity"]["agree %"] == "100.00"
    assert rows["rate of the head"]["agree %"] == f"{100 * (20 - steep) / 20:.2f}" and 0 < steep < 20
    assert float(rows["rate of the head"]["largest difference %"]) == pytest.approx(100 * 0.02 / 1.02, abs=0.01)
    assert "largest difference %" in witness_table(list(rows.values()))


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyretechnics", None)
    with pytest.raises(ValueError, match=r"witness needs pyretechnics, which is missing: pip install .*witness"):
        witness_errors(1)
