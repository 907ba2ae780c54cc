"""Some cells of maps are those cells of the whole maps."""

import torch

from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.law.listed import gradient, gradient_at, listed
from warp_torchrl.world.state.state import Landscape


def landscape() -> Landscape:
    generator = torch.Generator().manual_seed(0)
    cover, age = (torch.randint(0, 5, (3, 4, 5), generator=generator).to(torch.uint8) for _ in range(2))
    fuel = torch.randint(0, 99, (3, 4, 5), generator=generator).to(torch.int16)
    return Landscape(cover, age, torch.rand(3, 4, 5, generator=generator) * 90.0, layers=Named({"fuel": fuel}))


def test_cells_of_each_world_and_of_all_are_those_of_the_maps():
    ground, every = landscape(), torch.arange(20)
    rise = gradient(ground.elevation, ground.cover, 30.0)
    of_each = every.expand(3, -1)
    assert torch.equal(gradient_at(ground.elevation, ground.cover, 30.0, of_each), rise.flatten(2))
    assert torch.equal(listed(ground, of_each).layer("fuel"), ground.layer("fuel").flatten(1)[:, None])
    flat = torch.tensor([[59, 0, 24, 40, 19]])
    worlds, cells = flat[0] // 20, flat[0] % 20
    assert torch.equal(gradient_at(ground.elevation, ground.cover, 30.0, flat)[0], rise.flatten(2)[worlds, :, cells].T)
    assert torch.equal(listed(ground, flat).cover[0, 0], ground.cover.flatten(1)[worlds, cells])


def test_flat_ground_rises_nowhere():
    assert not gradient_at(None, landscape().cover, 30.0, torch.tensor([[3, 4]])).any()
