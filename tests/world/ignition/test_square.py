"""A square of fire in the middle."""

import pytest
import torch

from warp_torchrl.world.ignition.square import MiddleSquare
from warp_torchrl.world.terrain.landscape import Perlin


@pytest.mark.parametrize(("size", "side", "rows"), [(50, 4, range(23, 27)), (6, 3, range(1, 4)), (4, 4, range(4))])
def test_it_lights_the_fuel_of_the_middle_and_nothing_else(size, side, rows):
    fuel = torch.ones(2, size, size, dtype=torch.bool)
    fuel[1, rows[0], rows[0]] = False
    lit = MiddleSquare(side=side)(torch.zeros(2, dtype=torch.int64), fuel)
    assert sorted(set(lit[0].nonzero()[:, 0].tolist())) == sorted(set(lit[0].nonzero()[:, 1].tolist())) == list(rows)
    assert lit.sum((1, 2)).tolist() == [side * side, side * side - 1]


def test_it_must_fit_on_the_map():
    assert MiddleSquare(side=12).over(Perlin(size=(12, 20))).side == 12
    with pytest.raises(ValueError, match=r"ignition.side must fit on the map of \(12, 20\), got 13"):
        MiddleSquare(side=13).over(Perlin(size=(12, 20)))
    with pytest.raises(ValueError, match="side must be in"):
        MiddleSquare(side=0)
