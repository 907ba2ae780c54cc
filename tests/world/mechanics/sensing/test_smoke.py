"""Smoke."""

import pytest

from tests.world.drawing import draw
from warp_torchrl.world.mechanics.sensing.smoke import smoke


@pytest.mark.parametrize(
    ("wind", "expected"),
    [
        ((0.0, 0.0), [[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]]),
        ((9.0, 0.0), [[0, 0, 0, 0], [0, 1, 1 / 2, 1 / 3], [0, 0, 0, 0]]),  # to the east
        ((0.0, 2.0), [[0, 1 / 2, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]]),  # to the north
        ((-1.0, -1.0), [[0, 0, 0, 0], [0, 1, 0, 0], [1 / 2 + 1 / 3, 0, 0, 0]]),
    ],
)
def test_smoke_drifts_downwind_and_thins(wind, expected):
    state = draw("TTTT TaTT TTTT", wind=wind)
    # To the south-west, 0.7 and 1.4 cells down and across both are the diagonal neighbour.
    assert smoke(state, 2)[0].tolist() == [pytest.approx(row) for row in expected]
