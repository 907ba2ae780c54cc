"""What the heads and the rears of fires do that burn alone."""

import pytest
import torch

from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.fires.spell import heads


@pytest.mark.parametrize(("ratio", "rear"), [(2.0, 0.718), (1.0, 10.0)], ids=["an ellipse", "a round fire has no rear"])
def test_the_rear_goes_slower_by_the_eccentricity(ratio, rear):
    # Of length to breadth 2, e^2 = 3 / 4: 10 (1 - e) / (1 + e) = 0.718
    cell = torch.ones(1, 1, 1)
    spread = Spread(
        head=10.0 * cell,
        direction=0.0 * cell,
        length_to_breadth=ratio * cell,
        intensity=3000.0 * cell,
        flame_length=2.0 * cell,
        kind=cell,
    )
    assert heads(spread).flatten().tolist() == pytest.approx([10.0, rear, 3000.0, 2.0], abs=1e-3)
    assert heads(spread, with_kind=True).flatten().tolist()[4:] == [1.0]
