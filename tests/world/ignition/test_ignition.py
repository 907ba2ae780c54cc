"""Where the fire starts: on fuel, in the middle, always somewhere."""

import pytest
import torch
from scipy.stats import chi2
from torch import Tensor

from tests.world.drawing import marks
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ignition.ignition import Ignition


def keys(worlds: int, first: int = 0) -> Tensor:
    seed = torch.arange(first, first + worlds)
    return world_key(seed, torch.zeros_like(seed))


def fuel_everywhere(worlds: int, height: int, width: int) -> Tensor:
    return torch.ones(worlds, height, width, dtype=torch.bool)


def test_a_fire_is_a_patch_of_3_by_3() -> None:
    lit = Ignition(count=1)(keys(256), fuel_everywhere(256, 15, 11))
    assert (lit.sum((1, 2)) == 9).all()
    rows, columns = lit.any(dim=2), lit.any(dim=1)
    assert (rows.sum(dim=1) == 3).all()
    assert (columns.sum(dim=1) == 3).all()


@pytest.mark.parametrize("radius, cells", [(0, 1), (1, 9), (2, 25)])
def test_the_radius_makes_the_patch(radius: int, cells: int) -> None:
    lit = Ignition(count=1, radius=radius)(keys(64), fuel_everywhere(64, 20, 20))
    assert (lit.sum((1, 2)) == cells).all()


def test_only_fuel_is_lit() -> None:
    fuel = torch.rand(256, 13, 17, generator=torch.Generator().manual_seed(0)) < 0.3
    lit = Ignition(count=3, radius=2)(keys(256), fuel)
    assert not (lit & ~fuel).any()
    assert lit.flatten(1).any(dim=1).all()


def test_a_centre_lies_in_the_middle_of_height_and_of_width_and_anywhere_there() -> None:
    # 0.6 of 10 rows and 20 columns: rows 2..7, columns 4..15 (cell middles within 30 % of the map's middle).
    # 12 000 worlds over 72 cells, 71 degrees of freedom; false alarm 2e-6.
    lit = Ignition(count=1, radius=0)(keys(12_000), fuel_everywhere(12_000, 10, 20))
    counts = lit.sum(dim=0).double()
    middle = torch.zeros(10, 20, dtype=torch.bool)
    middle[2:8, 4:16] = True
    assert counts[~middle].sum() == 0
    expected = 12_000 / 72
    assert 1e-6 < chi2.sf(((counts[middle] - expected) ** 2 / expected).sum().item(), df=71) < 1 - 1e-6


def test_a_map_without_fuel_in_the_middle_is_lit_elsewhere() -> None:
    fuel = marks("x....... ........ ........ ........ ........ ........ ........ .......x", "x").expand(64, 8, 8)
    lit = Ignition(count=1, radius=1)(keys(64), fuel)
    assert (lit.sum((1, 2)) == 1).all()
    assert lit[:, 0, 0].any()
    assert lit[:, 7, 7].any()


def test_fuel_in_the_middle_comes_first() -> None:
    fuel = marks("xxxxx xxxxx xx.xx xxxxx xxxxx", "x")
    fuel[2, 2] = True
    lit = Ignition(count=1, radius=0, region=0.1)(keys(64), fuel.expand(64, 5, 5))
    assert lit[:, 2, 2].all()


def test_a_map_without_fuel_is_left_dark() -> None:
    assert not Ignition(count=4)(keys(4), torch.zeros(4, 8, 8, dtype=torch.bool)).any()


def test_more_fires_than_fuel_light_all_of_it() -> None:
    fuel = marks("x... .x.. .... ....", "x")[None]
    assert torch.equal(Ignition(count=4, radius=0)(keys(1), fuel), fuel)


def test_several_fires_start_on_different_cells() -> None:
    lit = Ignition(count=5, radius=0)(keys(200), fuel_everywhere(200, 12, 12))
    assert (lit.sum((1, 2)) == 5).all()


def test_a_fire_is_a_function_of_the_key_alone() -> None:
    batch = Ignition(count=1)(keys(64), fuel_everywhere(64, 12, 9))
    assert torch.equal(batch[20:21], Ignition(count=1)(keys(1, first=20), fuel_everywhere(1, 12, 9)))
    assert torch.equal(batch[20:27], Ignition(count=1)(keys(7, first=20), fuel_everywhere(7, 12, 9)))
    assert not torch.equal(batch[0], batch[1])
