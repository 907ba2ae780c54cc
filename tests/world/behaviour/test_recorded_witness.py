"""Rates are those that the package pyretechnics computed, for every fuel model."""

import csv
from pathlib import Path

import numpy as np
import pytest

from warp_torchrl import rate_of_spread
from warp_torchrl.benchmark.witness import of_crowns

RECORD = Path(__file__).parent / "witness.csv"  # of record_witness.py
CROWNS = RECORD.with_name("crown_witness.csv")
MOISTURES = ("dead_1h", "dead_10h", "dead_100h", "live_herbaceous", "live_woody")


def read(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        table = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in table]) for name in table[0]}


@pytest.fixture(scope="module")
def rows() -> dict[str, np.ndarray]:
    return read(RECORD)


@pytest.mark.parametrize("model", ["fbfm13", "fbfm40"])
def test_rates_are_those_on_record(rows, model) -> None:
    here = (rows["code"] < 100) == (model == "fbfm13")
    given = {name: column[here] for name, column in rows.items()}
    ours = rate_of_spread(
        given["code"],
        model,
        (given["speed"], given["bearing"]),
        given["slope"],
        given["aspect"],
        moisture={name: given[name] for name in MOISTURES},
        wind_height="midflame",
    )
    assert (given["head"] > 0.1).mean() > 0.5
    for name in ("head", "length_to_breadth", "intensity", "flame_length"):
        assert getattr(ours, name).numpy() == pytest.approx(given[name], rel=0.01, abs=1e-4), name
    is_driven = ((given["speed"] > 0) | (given["slope"] > 0)) & (given["head"] > 1e-3)
    turn = (ours.direction.numpy() - given["direction"] + 180) % 360 - 180
    assert np.abs(turn[is_driven]).max() < 0.2


def test_crown_fires_are_those_on_record() -> None:
    bed = read(CROWNS)
    ours = of_crowns(bed)
    assert (ours.kind.numpy() == bed["kind"]).all() and np.bincount(bed["kind"].astype(int)).min() >= 5
    for name in ("head", "intensity", "flame_length"):
        assert getattr(ours, name).numpy() == pytest.approx(bed[name], rel=0.01, abs=1e-4), name
