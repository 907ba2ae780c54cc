"""What is worked out at the fire's edge is what whole maps come to, to the bit."""

import pytest
import torch

from warp_torchrl.world.edge import places
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.hazard import HazardFire
from warp_torchrl.world.landscape import Perlin
from warp_torchrl.world.pattern import bit_of
from warp_torchrl.world.random import Stream, uniform, uniform_among
from warp_torchrl.world.wind import Paper, Uniform, Wandering, Wind
from warp_torchrl.world.world import World, advance

from .drawing import differing, draw

LAWS = [Fire(), Fire(burning_stages=5, neighbours=4, wind_gain=0.3), HazardFire(refinement=2)]


def test_places_are_found_word_by_word() -> None:
    generator = torch.Generator().manual_seed(0)
    for count in (0, 1, 7, 8, 63, 64, 4096, 4097):
        for share in (0.0, 0.03, 1.0):
            codes = (torch.rand(count, generator=generator) < share).to(torch.uint8) * 131
            assert places(codes).tolist() == [index for index, code in enumerate(codes.tolist()) if code]


def test_an_edge_by_hand() -> None:
    # Fire beside a lake, a tree too young, two that can ignite, and two that no burning cell touches.
    state = draw("~1.. a55. 55.5", worlds=2)
    edge = Fire().edge(state)
    assert edge.cell.tolist() == [5, 8, 9, 17, 20, 21]  # (1, 1), (2, 0) and (2, 1) of each world
    assert edge.world.tolist() == [0, 0, 0, 1, 1, 1] and edge.place.tolist() == [5, 8, 9] * 2
    east, south_east, south = (1 << bit_of(direction) for direction in (2, 3, 4))  # as the fire travels
    assert edge.pattern.tolist() == [east, south, south_east] * 2
    assert edge.on_map(torch.ones(6)).sum((1, 2)).tolist() == [3.0, 3.0]


@pytest.mark.parametrize("fire", LAWS, ids=["paper", "four", "hazard"])
@pytest.mark.parametrize("relief", [0.0, 300.0], ids=["level", "slopes"])
@pytest.mark.parametrize("wind", [Uniform(speed=7.0), Wandering(), Paper()], ids=["uniform", "wandering", "field"])
def test_the_edge_comes_to_what_whole_maps_do(fire: Fire, relief: float, wind: Wind) -> None:
    world = World(landscape=Perlin(size=(11, 13), relief=relief), fire=fire, wind=wind, steps_per_tick=1)
    state = world.reset(torch.arange(6), torch.zeros(6, dtype=torch.int64))
    stay, due = torch.full((6, world.team.n_agents), 10), torch.arange(6) != 2
    listed = 0
    for _ in range(15):
        assert fire.keeps_to_its_edge(state)
        front, chance = fire.outlook(state)
        assert torch.equal(chance, fire.chance_to_ignite(state)) and torch.equal(front, fire.front(state))
        edge, draws = fire.edge(state), uniform(state.key, state.tick, Stream.FIRE, world.size)
        at_edge = uniform_among(state.key, state.tick, Stream.FIRE, edge.world, edge.place)
        assert torch.equal(at_edge, edge.of(draws))
        assert differing(fire.tick_at_edge(state, edge, at_edge, due), fire.tick(state, draws, due)) == []
        listed += len(edge.cell)
        state = world.step(state, stay).after
    assert listed > 300


def test_planes_may_lie_in_memory_as_they_like() -> None:
    world = World(landscape=Perlin(size=16), steps_per_tick=1)
    state = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    spread_out = state.replace(
        **{name: getattr(state, name).mT.contiguous().mT for name in ("cells", "age", "wet", "burned", "alpha")}
    )
    assert not spread_out.cells.is_contiguous()
    everywhere = torch.ones(3, dtype=torch.bool)
    for _ in range(5):
        state, spread_out = (advance(each, world.fire, world.air, everywhere) for each in (state, spread_out))
        assert differing(spread_out, state) == []
    assert (state.cells == 11).any()


@pytest.mark.parametrize("fire", [Fire(growth=True), Fire(beta=1.0), Fire(p_regrow=0.1)])
def test_a_fire_that_may_start_anywhere_does_not_keep_to_its_edge(fire: Fire) -> None:
    state = draw("5a", fire=fire)
    assert Fire().keeps_to_its_edge(state) and not fire.keeps_to_its_edge(state)
