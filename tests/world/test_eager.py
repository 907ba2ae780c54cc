"""Which steps are compiled."""

import pytest
import torch

from warp_torchrl.world.eager import FEW_CELLS, why_eager
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.rate import RateFire


def test_compiled_steps_are_left_out_under_law_rate() -> None:
    assert "not compiled" in str(why_eager(RateFire(), torch.device("cpu"), 1))
    assert why_eager(Fire(), torch.device("cpu"), 1) is None


@pytest.mark.parametrize(
    ("vectors", "device", "cells", "compiles"),
    [
        ("AVX512", "cpu", 1024 * 32 * 32, True),
        ("AVX2", "cpu", 1024 * 32 * 32, False),
        ("AVX2", "cpu", FEW_CELLS, True),
        ("AVX2", "cpu", FEW_CELLS + 1, False),
        ("AVX2", "cuda", 1024 * 32 * 32, True),
    ],
)
def test_steps_are_compiled_where_that_gains(
    monkeypatch, vectors: str, device: str, cells: int, compiles: bool
) -> None:
    monkeypatch.setattr("warp_torchrl.world.eager.vectors", lambda: vectors)
    why = why_eager(Fire(), torch.device(device), cells)
    assert (why is None) == compiles
    assert compiles or f"{cells} cells is faster eager with {vectors}" in str(why)
