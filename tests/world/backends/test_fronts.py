"""Fronts at listed cells are those of each cell."""

import torch

from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.backends.fronts import fronts
from warp_torchrl.world.law.fronts import front_at
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World


def test_fronts_of_marked_cells_are_those_of_each_cell_to_the_bit() -> None:
    world = World(fire=RateFire(fire_deviation=0.2), wind=Uniform(speed=6.0), landscape=Perlin(size=24, relief=200.0))
    state = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    for _ in range(40):
        state = world.step(state, torch.zeros(3, world.team.n_agents, dtype=torch.int64)).after
    burns = is_burning(state.cells).flatten(1)
    cell = torch.arange(24 * 24).expand(3, -1)
    ours, all_cells = fronts(world.fire, state, cell, burns), front_at(world.fire, state, torch.arange(3 * 24 * 24))
    with unread():
        unlisted = fronts(world.fire, state, cell, burns)
    assert 20 < burns.sum() < burns.numel() / 2
    for one, other, third in zip(ours, all_cells, unlisted, strict=True):
        assert torch.equal(one[burns], other.view(3, -1)[burns]) and torch.equal(one[burns], third[burns])
    assert not torch.equal(ours.flame_length[burns].min(), ours.flame_length[burns].max())
