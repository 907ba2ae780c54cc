"""The fire's edge by hand."""

import torch

from tests.world.drawing import differing, draw
from warp_torchrl.world.backends.edge import AtEdge
from warp_torchrl.world.backends.table import bit_of
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World


def test_an_edge_by_hand() -> None:
    # Fire beside a lake, a tree too young, two that can ignite, and two that no burning cell touches.
    state = draw("~1.. a55. 55.5", worlds=2)
    edge = AtEdge(Fire()).edge(state)
    assert edge.cell.tolist() == [5, 8, 9, 17, 20, 21]  # (1, 1), (2, 0) and (2, 1) of each world
    assert edge.world.tolist() == [0, 0, 0, 1, 1, 1] and edge.place.tolist() == [5, 8, 9] * 2
    east, south_east, south = (1 << bit_of(direction) for direction in (2, 3, 4))  # as the fire travels
    assert edge.pattern.tolist() == [east, south, south_east] * 2
    assert edge.on_map(torch.ones(6)).sum((1, 2)).tolist() == [3.0, 3.0]


def test_planes_may_lie_in_memory_as_they_like() -> None:
    world = World(landscape=Perlin(size=16), steps_per_tick=1)
    state = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    spread_out = state.replace(
        **{name: getattr(state, name).mT.contiguous().mT for name in ("cells", "age", "wet", "burned")}
    )
    assert not spread_out.cells.is_contiguous()
    everywhere = torch.ones(3, dtype=torch.bool)
    for _ in range(5):
        state, spread_out = (advance(each, world.fire, world.air, everywhere) for each in (state, spread_out))
        assert differing(spread_out, state) == []
    assert (state.cells == 11).any()
